#include "common/sensor/odometry_continuity.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

Odometry At(double seconds, const Pose2& pose) {
  return {.sequence = 0, .stamp = StampFromSeconds(seconds), .T_odom_robot = pose};
}

// A step of 0.1 s, after one of the same time by `moved_before` if there was one.
bool IsOneDrive(const Pose2& before, const Pose2& after, const std::optional<Pose2>& moved_before = {}) {
  const Odometry earlier = At(9.9, moved_before ? before * moved_before->Inverse() : Pose2{});
  const Odometry from = At(10.0, before), to = At(10.1, after);
  return GoesOn({moved_before ? &earlier : nullptr, from, to, after});
}

// A step of a robot that had this speed, or of which nothing is known.
bool IsOneDrive(const Odometry& before, const Odometry& after, std::optional<double> speed_m_s) {
  const double step_s = 0.1;
  Odometry earlier = before;
  earlier.stamp -= StampFromSeconds(step_s);
  earlier.T_odom_robot = before.T_odom_robot * Pose2{-step_s * speed_m_s.value_or(0.0), 0, 0};
  return GoesOn({speed_m_s ? &earlier : nullptr, before, after, after.T_odom_robot});
}

TEST(OdometryContinuity, ABaseThatWasStartedAgainBeginsAtZero) {
  EXPECT_FALSE(IsOneDrive({1.2, 0, 0}, {0, 0, 0}));
  EXPECT_FALSE(IsOneDrive({1.2, 0, 0}, {0, 0, 0}, Pose2{0.1, 0, 0}));
  EXPECT_FALSE(IsOneDrive({0.31, 0, 0}, {0.01, 0, 0}, Pose2{0.02, 0, 0})) << "also where it was near its beginning";
  EXPECT_FALSE(IsOneDrive({0, 0, 1.4}, {0, 0, 0}, Pose2{})) << "also where it has only turned";
  EXPECT_TRUE(IsOneDrive({1.2, 0, 0}, {0.5, 0, 0}));
}

TEST(OdometryContinuity, ARobotThatComesByWhereItBeganHasNotBegunAnew) {
  EXPECT_TRUE(IsOneDrive({0.05, 0, -0.02}, {0, 0, 0}));
  EXPECT_TRUE(IsOneDrive({0, 0, -0.14}, {0, 0, 0.01}, Pose2{0, 0, 0.15})) << "it turns on the spot";
  EXPECT_TRUE(IsOneDrive({-0.3, 0, 0}, {0, 0, 0}, Pose2{0.16, 0, 0})) << "after a sample that came late";
  EXPECT_TRUE(IsOneDrive({-0.5, 0, 0}, {0, 0, 0}, Pose2{-0.5, 0, 0})) << "it goes back and forth";
}

// Where the wheels are corrected, what the base says is compared with zero.
TEST(OdometryContinuity, AsTheBaseSaysIt) {
  const Odometry before = At(10.0, {1.2, 0, 0}), after = At(10.1, {0.6, 0, 0});
  EXPECT_TRUE(GoesOn({nullptr, before, after, {0.6, 0, 0}}));
  EXPECT_FALSE(GoesOn({nullptr, before, after, {0, 0, 0}}));
}

TEST(OdometryContinuity, ARobotThatStoodIsNotFarAwayAfterAGap) {
  const Odometry before = At(10.0, {5, 0, 0});
  EXPECT_TRUE(IsOneDrive(before, At(11.5, {8.0, 0, 0}), 0.0));
  EXPECT_FALSE(IsOneDrive(before, At(11.5, {9.0, 0, 0}), 0.0));
  EXPECT_TRUE(IsOneDrive(before, At(11.5, {9.0, 0, 0}), 2.0));
  EXPECT_TRUE(IsOneDrive(before, At(11.5, {9.0, 0, 0}), std::nullopt));
  EXPECT_FALSE(IsOneDrive(before, At(11.5, {11.0, 0, 0}), 3.0)) << "faster than any robot";
}

TEST(OdometryContinuity, SlippingAndLateReportsAreDriving) {
  // What mit-csail has.
  EXPECT_TRUE(IsOneDrive(At(0.0, {3, 0, 0}), At(0.101, {3.3, 0.3, 1.37}), 0.8));
  EXPECT_TRUE(IsOneDrive(At(0.0, {3, 0, 0}), At(0.102, {4.257, 0, 0.53}), 0.4));
  EXPECT_FALSE(IsOneDrive(At(0.0, {3, 0, 0}), At(0.1, {3, 0, 2.5}), 0.0)) << "no robot turns so fast";
}

TEST(OdometryContinuity, AfterALongGapOnlyTheSamePlaceGoesOn) {
  EXPECT_TRUE(IsOneDrive(At(0.0, {3, 0, 0}), At(60.0, {3.5, 0, 0.5}), 0.0));
  EXPECT_FALSE(IsOneDrive(At(0.0, {3, 0, 0}), At(60.0, {4.5, 0, 0}), 1.0));
  EXPECT_FALSE(IsOneDrive(At(60.0, {3, 0, 0}), At(0.0, {4.5, 0, 0}), 1.0)) << "a clock that was set back";
}

TEST(OdometryContinuity, WhereTheTimeIsUnknownOnlyTheSamePlaceGoesOn) {
  const Odometry before = At(10.0, {5, 0, 0}), near = At(3.0, {5.2, 0, 0}), far = At(10.1, {6.2, 0, 0});
  EXPECT_TRUE(GoesOn({nullptr, before, near, near.T_odom_robot, false}));
  EXPECT_FALSE(GoesOn({nullptr, before, far, far.T_odom_robot, false}));
}

// Two samples with one stamp say that it is fast, not that its speed is infinite or no number.
TEST(OdometryContinuity, TheSpeedIsBounded) {
  const Odometry earlier = At(10.0, {4, 0, 0}), before = At(10.0, {5, 0, 0});
  const Odometry near = At(11.5, {9.0, 0, 0}), far = At(11.5, {11.0, 0, 0});
  EXPECT_TRUE(GoesOn({&earlier, before, near, near.T_odom_robot}));
  EXPECT_FALSE(GoesOn({&earlier, before, far, far.T_odom_robot}));
  EXPECT_TRUE(GoesOn({&before, before, near, near.T_odom_robot}));
}

}  // namespace
}  // namespace cairn
