// The Cyclone DDS robot against a server made of our Bus: both directions of every topic it uses, on the wire.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numeric>

#include "common/geometry/angle.h"
#include "tests/client/lib/fake_server.h"
#include "tests/loopback.h"
#include "tests/temp_directory.h"

namespace cairn::test {
namespace {

constexpr int kScans = 200;

// A robot that drives along a wall: enough for a server that does not look.
void WriteLog(const std::filesystem::path& path) {
  std::ofstream log(path);
  for (int i = 0; i < kScans + 5; ++i) {
    log << "ODOM " << i << " 0 0 0 0 0 " << i << " host " << i << "\n";
    log << "FLASER 180";
    for (int beam = 0; beam < 180; ++beam) log << " " << 1 + beam % 7;
    log << " " << i + 0.25 << " 0 0 " << i << " 0 0 " << 1000.5 + i << " host " << i << "\n";
  }
}

TEST(Cyclone, ARobotOfAnotherVendorStreamsAndAsks) {
  setenv("CYCLONEDDS_URI", "file://" CAIRN_CYCLONE_CONFIG, 1);
  const TempDirectory directory;
  const std::filesystem::path log = directory.path() / "wall.clf";
  WriteLog(log);
  FakeServer server(LoopbackOptions());
  TileSample tile;
  tile.site_id = HashName("hall");
  tile.tile.key = {2, -3, 4};
  tile.tile.bytes.assign(60000, 7);
  server.Publish(tile);  // Before the robot joins: transient-local.
  MapInfo map;
  map.site_id = HashName("hall");
  map.site = "hall";
  server.Publish(map);

  const std::string command = std::string(CAIRN_CYCLONE_ROBOT) + " " + std::to_string(TestDomain()) + " " +
                              log.string() + " hall cyclone-1 " + std::to_string(kScans);
  FILE* robot = popen(command.c_str(), "r");
  ASSERT_NE(robot, nullptr);
  char line[1024] = {};
  const bool said = std::fgets(line, sizeof(line), robot) != nullptr;
  EXPECT_EQ(pclose(robot), 0) << line;
  ASSERT_TRUE(said);
  EXPECT_THAT(line, ::testing::HasSubstr("\"ok\":true"));
  EXPECT_THAT(line, ::testing::HasSubstr("\"scans_sent\":200,\"settled\":200"));
  std::printf("%s", line);

  std::vector<std::uint64_t> expected(kScans);
  std::iota(expected.begin(), expected.end(), 1);
  EXPECT_EQ(server.received(), expected);
  EXPECT_TRUE(Eventually([&] { return server.odometry_received() == kScans; }));
  // What Cyclone sent is what arrived, field by field where it is easy to confuse.
  const ScanSample scan = server.last_scan();
  EXPECT_EQ(scan.stream.robot_id, HashName("cyclone-1"));
  EXPECT_EQ(scan.stream.sensor_id, HashName("laser"));
  EXPECT_EQ(scan.scan.stamp, StampFromSeconds(1000.5 + kScans - 1));
  EXPECT_DOUBLE_EQ(scan.scan.angle_first_rad, -kPi / 2);
  EXPECT_DOUBLE_EQ(scan.scan.angle_step_rad, kPi / 180);
  EXPECT_DOUBLE_EQ(scan.scan.range_max_m, 80.0);
  EXPECT_NEAR(scan.scan.T_robot_laser.x, 0.25, 1e-9);
  ASSERT_EQ(scan.scan.ranges_m.size(), 180U);
  EXPECT_EQ(scan.scan.ranges_m[8], 2.0F);
  EXPECT_EQ(server.datagrams_refused(), 0U);
}

}  // namespace
}  // namespace cairn::test
