#include "client/cli/ros2_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace cairn::client {
namespace {

constexpr ros2::Origin At(std::int64_t sequence) {
  return {{1}, sequence};
}

ros2::Pose3 Placed(const Pose2& pose) {
  return {{pose.x, pose.y, 0.1}, Eigen::Quaterniond(Eigen::AngleAxisd(pose.theta, Eigen::Vector3d::UnitZ()))};
}

ros2::Transforms One(const std::string& parent, const std::string& child, const Pose2& pose, Stamp stamp = 7) {
  ros2::Transforms message;
  message.transforms.push_back({{stamp, parent}, child, Placed(pose)});
  return message;
}

ros2::LaserScan Seen(Stamp stamp) {
  ros2::LaserScan scan;
  scan.header = {stamp, "laser"};
  scan.angle_increment = 0.5;
  scan.range_max = 10.0;
  scan.ranges = {1.0F, 2.0F};
  return scan;
}

class RosRobot : public ::testing::Test {
 protected:
  ros2::FrameTree shared_;
  Ros2Samples robot_{"r1", shared_};
};

TEST_F(RosRobot, GivesScansOnceOdometryAndMountingAreKnown) {
  EXPECT_FALSE(robot_.Take("scan", Seen(1), At(1)));
  EXPECT_TRUE(robot_.Take(One("base", "laser", {0.3, 0.0, 0.1}), At(1)).empty());
  EXPECT_FALSE(robot_.Take("scan", Seen(2), At(2))) << "nobody knows which frame is the robot";
  const auto odometry = robot_.Take(ros2::Odometry{{5, "odom"}, "base", Placed({1.0, 2.0, 0.5})}, At(1));
  ASSERT_TRUE(odometry);
  EXPECT_EQ(odometry->stream.robot_id, HashName("r1"));
  EXPECT_EQ(odometry->odometry.sequence, 1U);
  EXPECT_EQ(odometry->odometry.stamp, 5);
  EXPECT_NEAR(odometry->odometry.T_odom_robot.theta, 0.5, 1e-12);
  const auto scan = robot_.Take("scan", Seen(3), At(3));
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->stream.sensor_id, HashName("scan"));
  EXPECT_EQ(scan->scan.sequence, 3U);
  EXPECT_EQ(scan->scan.stamp, 3);
  EXPECT_NEAR(scan->scan.T_robot_laser.x, 0.3, 1e-12);
  EXPECT_EQ(robot_.Take("scan", Seen(4), At(6))->scan.sequence, 6U) << "two were lost on the way";
}

TEST_F(RosRobot, MayBeMountedByTheSharedTransforms) {
  ASSERT_TRUE(shared_.Set(One("base_footprint", "laser", {0.2, 0.0, 0.0}).transforms[0]));
  ASSERT_TRUE(robot_.Take(ros2::Odometry{{5, ""}, "", Placed({})}, At(1))) << "some drivers name no frames";
  const auto scan = robot_.Take("scan", Seen(1), At(1));
  ASSERT_TRUE(scan);
  EXPECT_NEAR(scan->scan.T_robot_laser.x, 0.2, 1e-12);
}

TEST_F(RosRobot, MaySayItsOdometryAsATransform) {
  EXPECT_EQ(robot_.Take(One("odom", "base_link", {1.0, 0.0, 0.0}), At(1)).size(), 1U);
  EXPECT_EQ(robot_.TakeShared(One("odom", "base_link", {}), true, At(2)).size(), 1U);
  EXPECT_TRUE(robot_.TakeShared(One("odom", "base_link", {}), false, At(3)).empty()) << "it may be another robot's";
  EXPECT_EQ(robot_.TakeShared(One("r1/odom", "r1/base_link", {}), false, At(4)).size(), 1U);
  EXPECT_TRUE(robot_.TakeShared(One("r2/odom", "r2/base_link", {}), true, At(5)).empty());
  EXPECT_TRUE(robot_.Take(One("base_link", "laser", {}), At(6)).empty());
  robot_.SetOdometryTopic(true);
  EXPECT_TRUE(robot_.Take(One("odom", "base_link", {}), At(7)).empty());
}

TEST_F(RosRobot, GivesNothingForWhatIsNoPose) {
  EXPECT_FALSE(robot_.Take(ros2::Odometry{{5, "odom"}, "base", Placed({std::nan(""), 0.0, 0.0})}, At(1)));
  ros2::Transforms broken = One("odom", "base_link", {});
  broken.transforms[0].T_frame_child.rotation.coeffs().setZero();
  EXPECT_TRUE(robot_.Take(broken, At(1)).empty());
}

}  // namespace
}  // namespace cairn::client
