#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/common/sensor/read_log.h"

namespace cairn {
namespace {

TEST(DpslamReader, PairsShareAStampAndFollowAtThePeriod) {
  const auto log = ReadText("Odometry 1 2 0.5 \nLaser 3 1 2 3 \nOdometry 1.1 2 0.5\nLaser 3 1 2 3\n");
  ASSERT_EQ(log.records.size(), 4u);
  EXPECT_EQ(log.odometries[0].stamp, 200'000'000);
  EXPECT_EQ(log.scans[0].stamp, 200'000'000);
  EXPECT_EQ(log.odometries[1].stamp, 400'000'000);
  EXPECT_EQ(log.scans[1].stamp, 400'000'000);
  EXPECT_EQ(log.summary.complaint_count, 0);
}

TEST(DpslamReader, OptionsGiveOffsetRangeAndPeriod) {
  LogReaderOptions options;
  options.dpslam_laser_forward_m = 0.1;
  options.dpslam_range_max_m = 5.0;
  options.dpslam_scan_period_s = 0.5;
  const auto log = ReadText("Odometry 1 2 0.5\nLaser 3 1 2 3\n", options);
  EXPECT_EQ(log.scans.at(0).T_robot_laser, (Pose2{0.1, 0, 0}));
  EXPECT_EQ(log.scans[0].range_max_m, 5.0);
  EXPECT_EQ(log.scans[0].stamp, 500'000'000);
  EXPECT_DOUBLE_EQ(log.scans[0].angle_step_rad, kPi / 2);
}

TEST(DpslamReader, OfTwoOdometriesInARowTheLaterCounts) {
  const auto log = ReadText("Odometry 1 2 0\nOdometry 9 2 0\nLaser 1 1\nOdometry 10 2 0\n");
  ASSERT_EQ(log.odometries.size(), 2u);
  EXPECT_EQ(log.odometries[0].T_odom_robot.x, 9);
  EXPECT_EQ(log.odometries[1].T_odom_robot.x, 10);  // Nothing follows it; motion is not lost.
  EXPECT_GT(log.odometries[1].stamp, log.scans.at(0).stamp);
  EXPECT_EQ(log.summary.ignored, 1);
}

TEST(DpslamReader, AMessageOfTheOtherFormatIsAComplaint) {
  const auto log = ReadText("Odometry 1 2 0\nLaser 1 1\nODOM 1 2 0 0 0 0 5 h 0\n");
  ASSERT_EQ(log.summary.complaint_count, 1);
  EXPECT_EQ(log.summary.complaints[0].line, 3);
  EXPECT_THAT(log.summary.complaints[0].reason, testing::HasSubstr("CARMEN message in a DP-SLAM log"));
}

}  // namespace
}  // namespace cairn
