// The door for ROS 2 with a discovery server of Fast DDS (Debian's fastdds-tools), where a robot finds it as robots
// with rmw_fastrtps do: through ROS_DISCOVERY_SERVER.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "server/ros2/ros2_door.h"
#include "tests/child_process.h"
#include "tests/free_port.h"
#include "tests/loopback.h"

namespace cairn::server {
namespace {

using test::Eventually;
using test::Must;

constexpr const char* kProgram = "/usr/bin/fast-discovery-server";

// The middleware reads the variable when a participant is made.
std::unique_ptr<ros2::Bus> RobotOf(const std::string& discovery_server) {
  setenv("ROS_DISCOVERY_SERVER", discovery_server.c_str(), 1);
  auto robot = Must(ros2::Bus::Create(test::LoopbackOptions(), "robot"));
  unsetenv("ROS_DISCOVERY_SERVER");
  return robot;
}

TEST(Ros2DiscoveryServer, RobotsAreFoundThroughItAndOnlyThroughIt) {
  if (!std::filesystem::exists(kProgram))
    GTEST_SKIP() << "SKIPPED: " << kProgram << " is not installed (package fastdds-tools)";
  const std::string port = std::to_string(test::FreePort());
  Ros2Options options;
  options.enabled = true;
  options.domain = test::TestDomain();
  options.discovery_servers = "127.0.0.1:" + port;
  ASSERT_TRUE(Validate(options));
  Inbound inbound(64);
  Outbound outbound(64);
  const auto door = Must(Ros2Door::Open(options, test::LoopbackOptions(), {}, inbound, outbound));
  door->Start();
  const auto robot = RobotOf(options.discovery_servers);
  const auto scans = Must(robot->Advertise<ros2::LaserScan>("rt/r1/scan", {true, false, 5}));
  EXPECT_FALSE(Eventually([&] { return !door->report().namespaces.empty(); }, std::chrono::seconds(1)));

  const ChildProcess meeting_place({kProgram, "-i", "0", "-l", "127.0.0.1", "-p", port});
  ASSERT_TRUE(Eventually([&] { return door->report().namespaces.size() == 1; }));
  EXPECT_EQ(door->report().namespaces[0].name, "/r1");
  // What it publishes arrives.
  ASSERT_TRUE(Eventually([&] { return scans->matched() == 1; }));
  ros2::LaserScan scan;
  scan.header = {kNanosPerSecond, "laser"};
  scan.angle_increment = 0.1;
  scan.range_max = 10.0;
  scan.ranges = {1.0F, 2.0F};
  EXPECT_TRUE(Eventually([&] {
    EXPECT_TRUE(scans->Publish(scan));
    return door->report().namespaces.at(0).topics.at(0).received > 0;
  }));
  EXPECT_EQ(door->report().door.malformed, 0U);
}

TEST(Ros2DiscoveryServer, AnAddressThatIsNoneIsRefusedByTheNameOfItsOption) {
  Ros2Options options;
  options.enabled = true;
  options.discovery_servers = "10.0.0.5, 10.0.0.6:11812";
  EXPECT_TRUE(Validate(options));
  options.discovery_servers = "10.0.0.5, mapper";
  const auto valid = Validate(options);
  ASSERT_FALSE(valid);
  EXPECT_EQ(valid.error().code, StatusCode::kInvalidArgument);
  EXPECT_EQ(valid.error().message.find("ros2.discovery_servers: 'mapper'"), 0U) << valid.error().message;
}

}  // namespace
}  // namespace cairn::server
