#include <gtest/gtest.h>

#include "server/slam/motion_models/motion_sampling.h"

namespace cairn::slam {
namespace {

TEST(InverseVelocity, UndoesApplyVelocityInEveryDirectionOfTravel) {
  const Pose2 start{1.0, -2.0, 0.8};
  for (double course = -3.1; course < 3.1; course += 0.3) {
    for (const double length : {0.0, 1e-12, 0.5}) {
      const Pose2 step{length * std::cos(course), length * std::sin(course), 0.3};
      const Pose2 end = ApplyVelocity(start, InverseVelocity(step)), expected = start * step;
      EXPECT_NEAR(end.x, expected.x, 1e-9);
      EXPECT_NEAR(end.y, expected.y, 1e-9);
      EXPECT_NEAR(AngleDiff(end.theta, expected.theta), 0.0, 1e-9);
    }
  }
}

TEST(ApplyVelocity, AQuarterCircle) {
  const Pose2 end = ApplyVelocity({}, {kPi, kPi / 2, 0.0});  // Radius 2.
  EXPECT_NEAR(end.x, 2.0, 1e-12);
  EXPECT_NEAR(end.y, 2.0, 1e-12);
  EXPECT_NEAR(end.theta, kPi / 2, 1e-12);
}

TEST(InverseVelocity, DrivingBackwardsIsNegativeSpeed) {
  const VelocityControl control = InverseVelocity({-0.5, 0.0, 0.0});
  EXPECT_NEAR(control.v, -0.5, 1e-12);
  EXPECT_NEAR(control.w, 0.0, 1e-12);
  EXPECT_NEAR(control.g, 0.0, 1e-12);
}

}  // namespace
}  // namespace cairn::slam
