#include "client/lib/ros2_findings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::client {
namespace {

TEST(Ros2Findings, AreTheLinesOfTheDoctor) {
  Ros2Report report;
  report.door = {.enabled = true, .domain = 7, .problems = {"two publishers contend for a frame"}};
  report.namespaces.resize(2);
  report.namespaces[0].name = "/r1";
  report.namespaces[0].robot = "r1";
  report.namespaces[0].site = "lab";
  report.namespaces[0].on_map = true;
  report.namespaces[0].topics = {{"/r1/scan", "sensor_msgs/msg/LaserScan", 1, true, false, 9.96, 120, 0},
                                 {"/r1/tf_static", "tf2_msgs/msg/TFMessage", 2, false, true, 0.0, 1, 3}};
  report.namespaces[1].name = "/";
  report.namespaces[1].problems = {"no rule of ros2.namespaces fits it", "no odometry"};
  report.namespaces[1].topics = {{"/scan", "sensor_msgs/msg/LaserScan", 1, true, false, 0.0, 0, 0}};
  EXPECT_EQ(
      FormatRos2(FindingsOf(report)),
      "ROS 2 in DDS domain 7\n"
      "! two publishers contend for a frame\n"
      "/r1  robot r1 in site lab: on the map\n"
      "    /r1/scan (sensor_msgs/msg/LaserScan): 1 publisher, reliable, 10.0 Hz, 120 received\n"
      "    /r1/tf_static (tf2_msgs/msg/TFMessage): 2 publishers, best effort, transient local, 0.0 Hz, 1 received, "
      "3 refused\n"
      "/  no robot: NOT on the map\n"
      "  - no rule of ros2.namespaces fits it\n"
      "  - no odometry\n"
      "    /scan (sensor_msgs/msg/LaserScan): 1 publisher, reliable, not listened to\n");
}

// A robot that is on the map may have something else that is wrong.
TEST(Ros2Findings, TellWhatIsWrongFromWhyItIsNotOnTheMap) {
  Ros2Report report;
  report.namespaces.resize(1);
  report.namespaces[0].name = "/r1";
  report.namespaces[0].on_map = true;
  report.namespaces[0].problems = {"another node also publishes map to odom"};
  EXPECT_EQ(FormatRos2(FindingsOf(report)),
            "ROS 2 in DDS domain 0\n"
            "/r1  no robot: on the map, but:\n"
            "  - another node also publishes map to odom\n");
}

TEST(Ros2Findings, SayWhatWasLostIfAnythingWas) {
  Ros2Report report;
  EXPECT_EQ(FindingsOf(report).where, "ROS 2 in DDS domain 0");
  report.door.malformed = 3;
  report.door.unpublished = 1;
  EXPECT_EQ(
      FindingsOf(report).where,
      "ROS 2 in DDS domain 0; messages since the server's start: 3 not decoded, 0 dropped for want of room, 1 not "
      "published");
}

TEST(Ros2Findings, SayWhatToLookAtWhereNobodyIsSeen) {
  Ros2Report report;
  EXPECT_THAT(FormatRos2(FindingsOf(report)), ::testing::HasSubstr("is ROS_DOMAIN_ID the same"));
  report.namespaces.resize(1);
  EXPECT_EQ(FindingsOf(report).advice, "");
}

}  // namespace
}  // namespace cairn::client
