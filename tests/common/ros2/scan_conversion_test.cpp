#include "common/ros2/scan_conversion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace cairn::ros2 {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

Eigen::Isometry3d Mounted(double roll, double pitch, double yaw) {
  Eigen::Isometry3d T_base_laser = Eigen::Isometry3d::Identity();
  T_base_laser.translation() = Eigen::Vector3d(0.3, -0.1, 0.5);
  T_base_laser.linear() =
      (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return T_base_laser;
}

LaserScan Message() {
  LaserScan message;
  message.header = {5 * kNanosPerSecond, "laser"};
  message.angle_min = -0.4;
  message.angle_increment = 0.2;
  message.range_min = 0.1;
  message.range_max = 10.0;
  message.ranges = {1.0F, 2.0F, 3.0F, 4.0F, 5.0F};
  return message;
}

// Where beam `i` ends, in the plane of the robot.
Eigen::Vector2d EndOf(const Scan& scan, std::size_t i) {
  const double angle = scan.angle_first_rad + static_cast<double>(i) * scan.angle_step_rad;
  const Eigen::Vector2d p_laser =
      scan.ranges_m[i] * Eigen::Vector2d(std::cos(angle) * std::cos(scan.tilt_rad), std::sin(angle));
  return scan.T_robot_laser * p_laser;
}

// Whatever the mounting, a beam ends where the transform in space puts it.
TEST(ScanConversion, EveryMountingPutsTheBeamsWhereTheTransformDoes) {
  for (const Eigen::Isometry3d& T_base_laser :
       {Mounted(0, 0, 0), Mounted(0, 0, 2.0), Mounted(kPi, 0, 0), Mounted(kPi, 0, -1.0), Mounted(0, 0.3, 0.5),
        Mounted(kPi, 0.3, 0.5), Mounted(0, kPi, 0)}) {
    const auto mounting = MountingOf(T_base_laser);
    ASSERT_TRUE(mounting) << mounting.error().message;
    const LaserScan message = Message();
    const Scan scan = ScanOf(LaserScan(message), *mounting);
    for (std::size_t i = 0; i < message.ranges.size(); ++i) {
      const double angle = message.angle_min + static_cast<double>(i) * message.angle_increment;
      const Eigen::Vector3d end =
          T_base_laser * Eigen::Vector3d(message.ranges[i] * std::cos(angle), message.ranges[i] * std::sin(angle), 0.0);
      EXPECT_NEAR((EndOf(scan, i) - end.head<2>()).norm(), 0.0, 1e-9) << "beam " << i;
    }
  }
}

TEST(ScanConversion, ALidarThatLeansToItsSideIsRefused) {
  const auto leaning = MountingOf(Mounted(0.5, 0, 0));
  ASSERT_FALSE(leaning);
  EXPECT_NE(leaning.error().message.find("29 degrees"), std::string::npos) << leaning.error().message;
  EXPECT_FALSE(MountingOf(Mounted(0, 1.4, 0)));
  EXPECT_TRUE(MountingOf(Mounted(0.1, 0, 0))) << "a few degrees are how robots are built";
}

TEST(ScanConversion, TheTimesAreThoseOfTheMessage) {
  LaserScan message = Message();
  message.time_increment = 0.01;
  EXPECT_EQ(ScanOf(LaserScan(message), {}).beam_period_s, 0.01);
  EXPECT_EQ(ScanOf(LaserScan(message), {}).stamp, 5 * kNanosPerSecond) << "ROS stamps the first ray";
  message.scan_time = 0.1;
  EXPECT_EQ(ScanOf(LaserScan(message), {}).beam_period_s, 0.01);
  message.scan_time = 0.02;  // Five rays of 0.01 s take longer than the whole turn.
  EXPECT_DOUBLE_EQ(ScanOf(LaserScan(message), {}).beam_period_s, 0.005);
  message.time_increment = 0.0;
  EXPECT_EQ(ScanOf(LaserScan(message), {}).beam_period_s, 0.0);
}

TEST(ScanConversion, RaysThatAreListedLastFirstAreOrderedByTheirTimes) {
  LaserScan message = Message();
  message.time_increment = -0.01;
  message.scan_time = 0.02;  // As above: it bounds the time between two rays.
  const Scan scan = ScanOf(LaserScan(message), {});
  ASSERT_EQ(scan.ranges_m.size(), message.ranges.size());
  EXPECT_DOUBLE_EQ(scan.beam_period_s, 0.005);
  EXPECT_EQ(scan.stamp, 5 * kNanosPerSecond - kNanosPerSecond / 50);
  EXPECT_EQ(scan.ranges_m.back(), message.ranges.front());
  EXPECT_NEAR(scan.angle_step_rad, -message.angle_increment, 1e-9);
}

// REP 117, and the comment of LaserScan.msg on values outside of range_min and range_max.
TEST(ScanConversion, RangesMeanWhatRosMeans) {
  LaserScan message = Message();
  message.ranges = {1.0F, std::nanf(""), kInfinity, -kInfinity, 0.05F, 10.0F, 10.5F, 0.0F};
  const Scan scan = ScanOf(std::move(message), {});
  const BeamClass expected[] = {BeamClass::kHit,     BeamClass::kInvalid,  BeamClass::kNoReturn, BeamClass::kInvalid,
                                BeamClass::kInvalid, BeamClass::kNoReturn, BeamClass::kInvalid,  BeamClass::kInvalid};
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i)
    EXPECT_EQ(ClassifyRange(scan.ranges_m[i], scan.range_min_m, scan.range_max_m), expected[i]) << i;
}

}  // namespace
}  // namespace cairn::ros2
