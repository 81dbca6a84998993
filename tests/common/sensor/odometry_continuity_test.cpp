#include "common/sensor/odometry_continuity.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

Odometry At(double seconds, const Pose2& pose) {
  return {.sequence = 0, .stamp = StampFromSeconds(seconds), .T_odom_robot = pose};
}

TEST(OdometryContinuity, ABaseThatWasStartedAgainBeginsAtZero) {
  EXPECT_TRUE(BeginsAtZero({0, 0, 0}, {-5, 0, 0}, {}));
  EXPECT_TRUE(BeginsAtZero({0, 0, 0}, {-5, 0, 0}, Pose2{0.1, 0, 0}));
  EXPECT_TRUE(BeginsAtZero({0.01, 0, 0}, {-0.3, 0, 0}, Pose2{0.02, 0, 0})) << "also where it was near its beginning";
  EXPECT_TRUE(BeginsAtZero({0, 0, 0}, {0, 0, 2.0}, Pose2{})) << "also where it has only turned";
  EXPECT_FALSE(BeginsAtZero({0.5, 0, 0}, {-5, 0, 0}, {}));
}

TEST(OdometryContinuity, ARobotThatComesByWhereItBeganHasNotBegunAnew) {
  EXPECT_FALSE(BeginsAtZero({0, 0, 0}, {-0.05, 0, 0.02}, {}));
  EXPECT_FALSE(BeginsAtZero({0, 0, 0.01}, {0, 0, 0.15}, Pose2{0, 0, 0.15})) << "it turns on the spot";
  EXPECT_FALSE(BeginsAtZero({0, 0, 0}, {0.3, 0, 0}, Pose2{0.16, 0, 0})) << "after a sample that came late";
  EXPECT_FALSE(BeginsAtZero({0, 0, 0}, {0.5, 0, 0}, Pose2{-0.5, 0, 0})) << "it goes back and forth";
}

TEST(OdometryContinuity, ARobotThatStoodIsNotFarAwayAfterAGap) {
  const Odometry before = At(10.0, {5, 0, 0});
  EXPECT_TRUE(MayBeOneDrive(before, At(11.5, {8.0, 0, 0}), 0.0));
  EXPECT_FALSE(MayBeOneDrive(before, At(11.5, {9.0, 0, 0}), 0.0));
  EXPECT_TRUE(MayBeOneDrive(before, At(11.5, {9.0, 0, 0}), 2.0));
  EXPECT_TRUE(MayBeOneDrive(before, At(11.5, {9.0, 0, 0}), std::nullopt));
  EXPECT_FALSE(MayBeOneDrive(before, At(11.5, {11.0, 0, 0}), 3.0)) << "faster than any robot";
}

TEST(OdometryContinuity, SlippingAndLateReportsAreDriving) {
  // What mit-csail has.
  EXPECT_TRUE(MayBeOneDrive(At(0.0, {3, 0, 0}), At(0.101, {3.3, 0.3, 1.37}), 0.8));
  EXPECT_TRUE(MayBeOneDrive(At(0.0, {3, 0, 0}), At(0.102, {4.257, 0, 0.53}), 0.4));
  EXPECT_FALSE(MayBeOneDrive(At(0.0, {3, 0, 0}), At(0.1, {3, 0, 2.5}), 0.0)) << "no robot turns so fast";
}

TEST(OdometryContinuity, AfterALongGapOnlyTheSamePlaceGoesOn) {
  EXPECT_TRUE(MayBeOneDrive(At(0.0, {3, 0, 0}), At(60.0, {3.5, 0, 0.5}), 0.0));
  EXPECT_FALSE(MayBeOneDrive(At(0.0, {3, 0, 0}), At(60.0, {4.5, 0, 0}), 1.0));
  EXPECT_FALSE(MayBeOneDrive(At(60.0, {3, 0, 0}), At(0.0, {4.5, 0, 0}), 1.0)) << "a clock that was set back";
}

TEST(OdometryContinuity, AStepIsJudgedByTheOneBefore) {
  const Odometry earlier = At(9.9, {5, 0, 0}), before = At(10.0, {5, 0, 0}), far = At(11.5, {9.0, 0, 0});
  const auto goes_on = [&](const Odometry* known, const Odometry& after, bool time_known = true) {
    return GoesOn({known, before, after, after.T_odom_robot, time_known});
  };
  EXPECT_TRUE(goes_on(nullptr, far));
  EXPECT_FALSE(goes_on(&earlier, far)) << "it stood";
  EXPECT_FALSE(goes_on(nullptr, At(10.1, {0, 0, 0}))) << "it begins at zero";
  EXPECT_TRUE(goes_on(nullptr, At(3.0, {5.2, 0, 0}), false));
  EXPECT_FALSE(goes_on(nullptr, At(10.1, {6.2, 0, 0}), false)) << "of another clock, and somewhere else";
}

TEST(OdometryContinuity, TheSpeedIsBounded) {
  EXPECT_DOUBLE_EQ(SpeedBetween(At(0.0, {0, 0, 0}), At(0.5, {1, 0, 0})), 2.0);
  EXPECT_DOUBLE_EQ(SpeedBetween(At(0.0, {0, 0, 0}), At(0.0, {1, 0, 0})), 3.0);
  EXPECT_DOUBLE_EQ(SpeedBetween(At(0.0, {0, 0, 0}), At(0.0, {0, 0, 0})), 3.0);
}

}  // namespace
}  // namespace cairn
