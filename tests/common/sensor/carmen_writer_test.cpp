#include "common/sensor/carmen_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <sstream>

#include "tests/common/sensor/read_log.h"

namespace cairn {
namespace {

Scan FlaserScan() {
  Scan scan;
  scan.stamp = 1'134'864'630'032'484'123;
  scan.angle_first_rad = -kPi / 2;
  scan.angle_step_rad = kPi / 180;
  scan.range_max_m = 80;
  for (int i = 0; i < 180; ++i) scan.ranges_m.push_back(0.1F + 0.333F * static_cast<float>(i));
  return scan;
}

LogContent WriteAndRead(const Scan& scan, const Pose2& T_odom_robot, std::string* text = nullptr) {
  std::ostringstream out;
  CarmenWriter writer(out);
  writer.Write(scan, T_odom_robot);
  if (text != nullptr) *text = out.str();
  return ReadText(out.str());
}

TEST(CarmenWriter, AHalfTurnSickScanIsAFlaserAndComesBackExactly) {
  const Scan scan = FlaserScan();
  const Pose2 T_odom_robot{576.123456789012, -0.1, 2.5};
  std::string text;
  const auto log = WriteAndRead(scan, T_odom_robot, &text);
  EXPECT_THAT(text, testing::StartsWith("FLASER 180 "));
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_EQ(log.scans[0].ranges_m, scan.ranges_m);
  EXPECT_EQ(log.scans[0].stamp, scan.stamp);
  EXPECT_EQ(log.scans[0].angle_step_rad, scan.angle_step_rad);
  EXPECT_EQ(log.scans[0].range_max_m, 80.0);
  EXPECT_EQ(log.odometries.at(0).T_odom_robot, T_odom_robot);
  EXPECT_EQ(log.odometries[0].stamp, scan.stamp);
}

TEST(CarmenWriter, OtherScannersAreRobotLasersAndComeBackExactly) {
  Scan scan = FlaserScan();
  scan.angle_first_rad = kPi;  // Full turn, clockwise.
  scan.angle_step_rad = -2 * kPi / 360;
  scan.range_max_m = 12.3;
  scan.ranges_m.assign(360, 4.56789F);
  scan.T_robot_laser = {0.2, -0.05, 0.1};
  std::string text;
  const auto log = WriteAndRead(scan, {1, 2, 3}, &text);
  EXPECT_THAT(text, testing::StartsWith("ROBOTLASER1 "));
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_EQ(log.scans[0].angle_first_rad, scan.angle_first_rad);
  EXPECT_EQ(log.scans[0].angle_step_rad, scan.angle_step_rad);
  EXPECT_EQ(log.scans[0].range_max_m, scan.range_max_m);
  EXPECT_EQ(log.scans[0].ranges_m, scan.ranges_m);
  EXPECT_EQ(log.scans[0].T_robot_laser, scan.T_robot_laser);
}

TEST(CarmenWriter, EveryBeamKeepsItsClass) {
  Scan scan = FlaserScan();
  scan.range_min_m = 0.2;
  scan.range_max_m = 12.3;  // Not a float: the one just below must not be written for it.
  constexpr float kInf = std::numeric_limits<float>::infinity(), kNan = std::numeric_limits<float>::quiet_NaN();
  scan.ranges_m = {1.0F, kInf, kNan, -1.0F, 0.0F, 0.1F, 12.3F, 50.0F, 12.2F};
  const auto log = WriteAndRead(scan, {});
  const Scan& read = log.scans.at(0);
  ASSERT_EQ(read.ranges_m.size(), scan.ranges_m.size());
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    EXPECT_EQ(ClassifyRange(read.ranges_m[i], read.range_min_m, read.range_max_m),
              ClassifyRange(scan.ranges_m[i], scan.range_min_m, scan.range_max_m))
        << i;
  }
}

TEST(CarmenWriter, OdometryComesBackExactly) {
  std::ostringstream out;
  CarmenWriter writer(out);
  writer.Write(Odometry{0, 5'000'000'001, {0.1, 1e-7, -3.1}});
  writer.Write(Odometry{0, 6'500'000'000, {1e6 / 3, -2, 3.1}});
  const auto log = ReadText(out.str());
  ASSERT_EQ(log.odometries.size(), 2u);
  EXPECT_EQ(log.odometries[0].stamp, 5'000'000'001);
  EXPECT_EQ(log.odometries[0].T_odom_robot, (Pose2{0.1, 1e-7, -3.1}));
  EXPECT_EQ(log.odometries[1].T_odom_robot, (Pose2{1e6 / 3, -2, 3.1}));
}

}  // namespace
}  // namespace cairn
