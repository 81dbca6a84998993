#include "client/cli/trajectory_error.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cairn::client {
namespace {

// A circle of 10 m radius, one pose every 0.1 s.
Trajectory Circle(int poses) {
  Trajectory circle;
  for (int i = 0; i < poses; ++i) {
    const double angle = 0.01 * i;
    circle.push_back({i * kNanosPerSecond / 10, {10 * std::cos(angle), 10 * std::sin(angle), WrapAngle(angle)}});
  }
  return circle;
}

Trajectory Moved(const Trajectory& trajectory, const Pose2& T_new_old) {
  Trajectory moved = trajectory;
  for (StampedPose& pose : moved) pose.T_map_robot = T_new_old * pose.T_map_robot;
  return moved;
}

TEST(TrajectoryError, TheTruthHasNone) {
  const auto error = CompareTrajectories(Circle(300), Circle(300), Alignment::kNone);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->compared, 300u);
  EXPECT_EQ(error->rmse_m, 0.0);
  EXPECT_EQ(error->max_rad, 0.0);
  EXPECT_NEAR(error->way_m, 10 * 0.01 * 299, 1e-3);
}

TEST(TrajectoryError, AShiftIsTheErrorUnlessAligned) {
  const Trajectory estimate = Moved(Circle(300), {0.3, 0.4, 0});
  const auto plain = CompareTrajectories(estimate, Circle(300), Alignment::kNone);
  ASSERT_TRUE(plain);
  EXPECT_NEAR(plain->rmse_m, 0.5, 1e-12);
  EXPECT_NEAR(plain->median_m, 0.5, 1e-12);
  EXPECT_NEAR(plain->final_m, 0.5, 1e-12);
  const auto aligned = CompareTrajectories(Moved(Circle(300), {3, -4, 2.5}), Circle(300), Alignment::kSe2);
  ASSERT_TRUE(aligned);
  EXPECT_NEAR(aligned->rmse_m, 0.0, 1e-9);
  EXPECT_NEAR(aligned->max_rad, 0.0, 1e-9);
}

TEST(TrajectoryError, ReportsSpreadAndHeading) {
  Trajectory estimate = Circle(4);
  estimate[2].T_map_robot.x += 2.0;
  estimate[3].T_map_robot.theta += 0.2;
  const auto error = CompareTrajectories(estimate, Circle(4), Alignment::kNone);
  ASSERT_TRUE(error);
  EXPECT_NEAR(error->rmse_m, 1.0, 1e-12);
  EXPECT_NEAR(error->mean_m, 0.5, 1e-12);
  EXPECT_NEAR(error->max_m, 2.0, 1e-12);
  EXPECT_NEAR(error->rmse_rad, 0.1, 1e-12);
}

TEST(TrajectoryError, TheTruthIsInterpolatedButNotAcrossGaps) {
  Trajectory truth = {{0, {0, 0, 0}}, {kNanosPerSecond / 5, {1, 0, 0}}, {10 * kNanosPerSecond, {9, 0, 0}}};
  const Trajectory estimate = {{-5, {0, 0, 0}},
                               {kNanosPerSecond / 10, {0.5, 0, 0}},
                               {5 * kNanosPerSecond, {4, 0, 0}},
                               {11 * kNanosPerSecond, {9, 0, 0}}};
  const auto error = CompareTrajectories(estimate, truth, Alignment::kNone);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->compared, 1u);
  EXPECT_EQ(error->skipped, 3u);
  EXPECT_NEAR(error->rmse_m, 0.0, 1e-12);
}

TEST(TrajectoryError, NothingToCompareIsAnError) {
  EXPECT_FALSE(CompareTrajectories({}, Circle(3), Alignment::kNone));
  EXPECT_FALSE(CompareTrajectories(Circle(3), {}, Alignment::kSe2));
}

}  // namespace
}  // namespace cairn::client
