// A server that dies without warning and comes back, without its memory or with it, under two robots that drive on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "client/lib/map_client.h"
#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/system/rider.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using namespace test;

class Restart : public ::testing::Test {
 protected:
  static constexpr int kRobots = 2;

  // The server stores nothing, or its state stays and the robots have little memory for what it has not stored.
  explicit Restart(bool stored = false)
      : state_(stored ? (directory_ / "state").string() : "none"), bus_(MakeBus("robots")), fleet_(MakeFleet()) {
    StartServer("20");
    for (int i = 0; i < kRobots; ++i) {
      RobotClientOptions options;
      if (stored)
        options = {.max_kept_bytes = 8 * 1024, .spill_file = (directory_ / ("spill" + std::to_string(i))).string()};
      riders_.push_back(std::make_unique<Rider>(*bus_, fleet_.name(i), "office", fleet_.T_map_robot_start(i), options));
    }
  }

  static sim::Fleet MakeFleet() {
    sim::FleetOptions options;
    options.robots = kRobots;
    options.laser.beams = 181;
    return Must(sim::Fleet::Create(Must(sim::OpenSurroundings("office")), options));
  }
  // How often it publishes the map, so how fast its versions grow.
  void StartServer(const std::string& publish_rate_hz = "2") {
    server_.reset();
    server_.emplace(std::vector<std::string>{CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--state", state_,
                                             "--set", "slam.particles=20", "--set",
                                             "maps.publish_rate_hz=" + publish_rate_hz, "--log-level", "warn"});
  }
  void KillServer() {
    server_->Signal(SIGKILL);
    server_->Wait();
  }
  // Drives until each robot has taken so many scans in all. While a server is there, no robot runs far ahead of it.
  void Drive(std::size_t scans, bool served) {
    while (fleet_.truth(0).size() < scans || fleet_.truth(1).size() < scans) {
      const sim::FleetRecord next = fleet_.Next();
      Rider& rider = *riders_[static_cast<std::size_t>(next.robot)];
      rider.Publish(next.record);
      if (!served || std::holds_alternative<Odometry>(next.record)) continue;
      ASSERT_TRUE(HasPoses(next.robot, rider.scans() - std::min<std::size_t>(rider.scans(), 16)));
    }
  }
  // Whether the server has given so many poses, of all servers.
  bool HasPoses(int robot, std::size_t count) {
    return Eventually([&] { return riders_[static_cast<std::size_t>(robot)]->poses().size() >= count; },
                      std::chrono::seconds(60));
  }
  // The largest distance of a told pose from where the robot was.
  double WorstError(int robot, Stamp since) {
    double worst_m = 0.0;
    const auto poses = riders_[static_cast<std::size_t>(robot)]->poses();
    for (const StampedPose& truth : fleet_.truth(robot)) {
      const auto told = poses.find(truth.stamp);
      if (truth.stamp < since || told == poses.end()) continue;
      const Eigen::Vector2d error = told->second.T_map_robot.translation() - truth.T_map_robot.translation();
      worst_m = std::max(worst_m, error.norm());
    }
    return worst_m;
  }

  const TempDirectory directory_;
  const std::string state_;
  std::optional<ChildProcess> server_;
  const std::unique_ptr<wire::Bus> bus_;
  sim::Fleet fleet_;
  std::vector<std::unique_ptr<Rider>> riders_;
};

class RestartOnItsState : public Restart {
 protected:
  RestartOnItsState() : Restart(true) {}
};

using TileVersions = std::map<TileKey, std::uint64_t>;

TileVersions VersionsOf(const MapClient& map) {
  TileVersions versions;
  for (const Tile& tile : map.tiles()) versions[tile.key] = tile.version;
  return versions;
}

// Robots were put where they had once begun, and said to be tracking there: 6.7 m away.
TEST_F(Restart, TwoRobotsGoOnWhereTheyAreThoughTheServerForgotThem) {
  ASSERT_NO_FATAL_FAILURE(Drive(10, true));
  const auto map = Must(MapClient::Create(*bus_, "office"));
  ASSERT_TRUE(map->WaitComplete(20.0));
  for (std::size_t scans = 15; scans <= 40; scans += 5) {
    const std::uint64_t version = map->version();
    ASSERT_NO_FATAL_FAILURE(Drive(scans, true));
    ASSERT_TRUE(Eventually([&] { return map->version() > version; }));
  }
  const Generation first = map->info()->generation;
  const std::uint64_t first_version = map->version();
  KillServer();
  ASSERT_NO_FATAL_FAILURE(Drive(60, false));
  EXPECT_FALSE(map->tiles().empty()) << "what the last server said is there until another one says more";
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(90, true));
  EXPECT_TRUE(Eventually([&] { return map->info() && map->info()->generation > first; }));
  KillServer();
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(120, true));
  for (int i = 0; i < kRobots; ++i) {
    Rider& rider = *riders_[static_cast<std::size_t>(i)];
    const Trajectory& truth = fleet_.truth(i);
    // The last scan may wait for the odometry after it.
    const auto has_last = [&] { return rider.poses().rbegin()->first >= truth[truth.size() - 2].stamp; };
    ASSERT_TRUE(Eventually(has_last)) << rider.poses().size() << " poses of " << rider.scans() << " scans";
    EXPECT_EQ(rider.client().restarted(), 2);
    EXPECT_EQ(rider.client().displaced(), 0U);
    // The robot has moved so far that its first start would be wrong.
    const double moved_m = (truth[40].T_map_robot.translation() - truth.front().T_map_robot.translation()).norm();
    EXPECT_GT(moved_m, 2.0);
    // What a few particles drift in this world; the first start is 2 m away and more.
    EXPECT_LT(WorstError(i, truth.front().stamp), 0.6);
    // The twenty that were scanned while no server was there are not lost. Poses on their way to the robot when a
    // server was killed may be.
    EXPECT_GE(rider.poses().size(), 110U);
    EXPECT_TRUE(rider.client().pose()->localized);
  }
  // The client of the map has that of the last server and nothing of the ones before. Epochs and versions of each begin
  // anew, and the first server's versions were higher.
  const auto newcomer = Must(MapClient::Create(*bus_, "office"));
  ASSERT_TRUE(newcomer->WaitComplete(20.0));
  EXPECT_TRUE(Eventually([&] { return VersionsOf(*map) == VersionsOf(*newcomer); }));
  EXPECT_EQ(map->info()->generation, newcomer->info()->generation);
  EXPECT_GT(map->tiles().size(), 0U);
  EXPECT_LT(map->version(), first_version);
  // On a busy machine a new server's answer may come a second before its map, and then it joins anew.
  EXPECT_LE(map->renewed(), 2) << "it did not join the domain again and again";
}

TEST_F(RestartOnItsState, WhatDoesNotFitIntoMemoryComesOnceFromTheSpillFile) {
  ASSERT_NO_FATAL_FAILURE(Drive(30, true));
  KillServer();
  ASSERT_NO_FATAL_FAILURE(Drive(90, false));
  for (const auto& rider : riders_) EXPECT_GT(rider->client().spilled_bytes(), 30U * 1024);
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(100, true));
  for (int i = 0; i < kRobots; ++i) {
    Rider& rider = *riders_[static_cast<std::size_t>(i)];
    ASSERT_TRUE(rider.client().WaitSafe(30.0));
    // The last scan may wait for the odometry after it.
    ASSERT_TRUE(Eventually([&] { return rider.client().ledger()->used + 1 >= rider.scans(); }));
    const auto ledger = rider.client().ledger();
    EXPECT_EQ(ledger->received, rider.scans());
    EXPECT_EQ(ledger->last_sequence, rider.scans());
    EXPECT_EQ(ledger->durable_through, rider.scans());
    EXPECT_EQ(ledger->used + ledger->waiting, rider.scans());
    EXPECT_LE(ledger->waiting, 1U);
    EXPECT_EQ(ledger->dropped_total(), 0U);
    EXPECT_EQ(rider.client().restarted(), 0) << "the server knew the session";
    EXPECT_EQ(rider.client().displaced(), 0U);
    EXPECT_EQ(rider.client().spill_error(), "");
    EXPECT_TRUE(Eventually([&] { return rider.client().spilled_bytes() == 0; })) << "all of it was stored";
  }
}

}  // namespace
}  // namespace cairn::client
