// A server that dies without warning and comes back without its memory, under two robots that drive on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <optional>

#include "client/lib/map_client.h"
#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/system/rider.h"

namespace cairn::client {
namespace {

using namespace test;

class Restart : public ::testing::Test {
 protected:
  static constexpr int kRobots = 2;

  Restart() : bus_(MakeBus("robots")), fleet_(MakeFleet()) {
    StartServer();
    for (int i = 0; i < kRobots; ++i)
      riders_.push_back(std::make_unique<Rider>(*bus_, fleet_.name(i), "office", fleet_.T_map_robot_start(i)));
  }

  static sim::Fleet MakeFleet() {
    sim::FleetOptions options;
    options.robots = kRobots;
    options.laser.beams = 181;
    return Must(sim::Fleet::Create(Must(sim::OpenSurroundings("office")), options));
  }
  void StartServer() {
    server_.reset();
    server_.emplace(std::vector<std::string>{CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--state",
                                             ":memory:", "--set", "slam.particles=20", "--log-level", "warn"});
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

  std::optional<ChildProcess> server_;
  const std::unique_ptr<wire::Bus> bus_;
  sim::Fleet fleet_;
  std::vector<std::unique_ptr<Rider>> riders_;
};

// Robots were put where they had once begun, and said to be tracking there: 6.7 m away.
TEST_F(Restart, TwoRobotsGoOnWhereTheyAreThoughTheServerForgotThem) {
  ASSERT_NO_FATAL_FAILURE(Drive(40, true));
  KillServer();
  ASSERT_NO_FATAL_FAILURE(Drive(60, false));
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(90, true));
  KillServer();
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(120, true));
  for (int i = 0; i < kRobots; ++i) {
    Rider& rider = *riders_[static_cast<std::size_t>(i)];
    const Trajectory& truth = fleet_.truth(i);
    ASSERT_TRUE(Eventually([&] { return rider.poses().contains(truth.back().stamp) || rider.poses().size() >= 119; }));
    EXPECT_EQ(rider.client().restarted(), 2);
    EXPECT_EQ(rider.client().displaced(), 0U);
    // The robot has moved so far that its first start would be wrong.
    const double moved_m = (truth[40].T_map_robot.translation() - truth.front().T_map_robot.translation()).norm();
    EXPECT_GT(moved_m, 2.0);
    // What a few particles drift in this world; the first start is 2 m away and more.
    EXPECT_LT(WorstError(i, truth.front().stamp), 0.6);
    // What was scanned while no server was there is not lost.
    EXPECT_GE(rider.poses().size(), 118U);
    EXPECT_TRUE(rider.client().pose()->localized);
  }
}

}  // namespace
}  // namespace cairn::client
