#include "server/slam/calibration/differential_drive.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cairn::slam {
namespace {

TEST(DifferentialDrive, EqualWheelsGoStraightOppositeOnesTurnOnTheSpot) {
  const Pose2 straight = MotionOfTravel({0.7, 0.7}, 0.4);
  EXPECT_EQ(straight, (Pose2{0.7, 0.0, 0.0}));
  const Pose2 spot = MotionOfTravel({-0.1, 0.1}, 0.4);
  EXPECT_NEAR(spot.x, 0.0, 1e-15);
  EXPECT_NEAR(spot.theta, 0.5, 1e-15);
}

TEST(DifferentialDrive, AHalfCircleEndsBesideItsStart) {
  const Pose2 end = MotionOfTravel(TravelOfArc(kPi * 2.0, kPi, 0.4), 0.4);
  EXPECT_NEAR(end.x, 0.0, 1e-12);
  EXPECT_NEAR(end.y, 4.0, 1e-12);
  EXPECT_NEAR(std::abs(AngleDiff(end.theta, kPi)), 0.0, 1e-12);
}

// Law: however finely an arc is cut, it ends at the same place (the rectangle rule of (3.6) does not).
TEST(DifferentialDrive, CuttingAnArcDoesNotMoveItsEnd) {
  for (const double turn : {-2.0, -1e-7, 0.0, 1e-5, 0.3, 2.5}) {
    const WheelTravel whole = TravelOfArc(1.3, turn, 0.5);
    Pose2 cut;
    for (int i = 0; i < 13; ++i) cut = cut * MotionOfTravel({whole.left_m / 13, whole.right_m / 13}, 0.5);
    const Pose2 once = MotionOfTravel(whole, 0.5);
    EXPECT_NEAR(cut.x, once.x, 1e-12);
    EXPECT_NEAR(cut.y, once.y, 1e-12);
    EXPECT_NEAR(AngleDiff(cut.theta, once.theta), 0.0, 1e-12);
  }
}

}  // namespace
}  // namespace cairn::slam
