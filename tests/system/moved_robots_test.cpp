// Robots that nobody watched for a while, and a server that was killed meanwhile: carried elsewhere, odometry that
// began anew, names that were exchanged. At no time is a pose called localized beside the truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <map>
#include <optional>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/system/rider.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using namespace test;

constexpr double kWrong_m = 0.5, kWrong_rad = 0.5;

class MovedRobots : public ::testing::Test {
 protected:
  static constexpr int kRobots = 2;

  MovedRobots() : bus_(MakeBus("robots")), fleet_(MakeFleet()) {
    StartServer();
    for (int i = 0; i < kRobots; ++i) Ride(i, fleet_.name(i), fleet_.T_map_robot_start(i));
  }

  static sim::Fleet MakeFleet() {
    sim::FleetOptions options;
    options.robots = kRobots;
    options.scan_hz = 5.0;
    options.odometry_hz = 10.0;
    options.laser.beams = 181;
    return Must(sim::Fleet::Create(Must(sim::OpenSurroundings("building")), options));
  }
  void StartServer() {
    server_.reset();
    server_.emplace(std::vector<std::string>{CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--state",
                                             stores_ ? state_.path().string() : "none", "--set", "slam.particles=30",
                                             "--set", "robots.checkpoint_entries=100"});
    ASSERT_TRUE(server_->Says(" ready"));
  }
  void KillServer() {
    server_->Signal(SIGKILL);
    server_->Wait();
  }
  void Ride(int robot, const std::string& name, const std::optional<Pose2>& start) {
    riders_[robot] = std::make_unique<Rider>(*bus_, name, "building", start);
  }
  void Leave(int robot) {
    Must(riders_[robot]->client().WaitSettled(10.0));
    Keep(robot);
    riders_[robot].reset();
  }
  // Takes the poses told so far into account.
  void Keep(int robot) {
    for (const auto& [stamp, pose] : riders_[robot]->poses()) told_[robot][stamp] = pose;
  }

  enum class Odometer { kGoesOn, kStandsStill, kStartsAtZero, kExchanged };
  // What the odometry shows from the next sample on.
  void Set(int robot, Odometer odometer) { set_[robot] = odometer; }
  // Each goes on from what the other one has shown last.
  void ExchangeOdometry() {
    before_exchange_ = shown_;
    for (int robot = 0; robot < kRobots; ++robot) Set(robot, Odometer::kExchanged);
  }

  // Robots drive for so long. Those that are not watched send nothing.
  void Drive(double seconds, const std::vector<int>& watched) {
    const Stamp end = now_ + StampFromSeconds(seconds);
    while (now_ < end) {
      sim::FleetRecord next = fleet_.Next();
      now_ = std::visit([](const auto& record) { return record.stamp; }, next.record);
      if (!std::ranges::count(watched, next.robot)) continue;
      if (auto* const odometry = std::get_if<Odometry>(&next.record)) Show(next.robot, *odometry);
      Rider& rider = *riders_[next.robot];
      rider.Publish(next.record);
      if (std::holds_alternative<Odometry>(next.record) || rider.scans() % 16 != 0) continue;
      ASSERT_TRUE(rider.client().WaitSettled(30.0)) << next.robot << ": " << Told(next.robot);
    }
    for (const int robot : watched) ASSERT_TRUE(riders_[robot]->client().WaitSettled(30.0)) << robot;
  }
  void Show(int robot, Odometry& odometry) {
    if (const auto set = set_.find(robot); set != set_.end()) {
      const Pose2 shown = set->second == Odometer::kStandsStill ? shown_[robot]
                          : set->second == Odometer::kExchanged ? before_exchange_[1 - robot]
                                                                : Pose2{};
      if (set->second != Odometer::kGoesOn) T_shown_odom_[robot] = shown * odometry.T_odom_robot.Inverse();
      set_.erase(set);
    }
    odometry.T_odom_robot = shown_[robot] = T_shown_odom_[robot] * odometry.T_odom_robot;
  }

  // Of all poses told: those called localized beside the truth.
  int Wrong() {
    int wrong = 0;
    for (const auto& [robot, rider] : riders_)
      if (rider) Keep(robot);
    for (const auto& [robot, poses] : told_) {
      for (const auto& [stamp, pose] : poses) {
        const auto truth = PoseOn(fleet_.truth(robot), stamp, 1.0);
        EXPECT_TRUE(truth);
        const double error_m = (pose.T_map_robot.translation() - truth->translation()).norm();
        const double error_rad = std::abs(AngleDiff(pose.T_map_robot.theta, truth->theta));
        wrong += pose.localized && (error_m > kWrong_m || error_rad > kWrong_rad) ? 1 : 0;
      }
    }
    return wrong;
  }
  // The first pose told since.
  std::optional<PoseReport> FirstPose(int robot, Stamp since) {
    Keep(robot);
    const auto found = told_[robot].lower_bound(since);
    return found == told_[robot].end() ? std::nullopt : std::optional(found->second);
  }
  bool IsLocalized(int robot) {
    const auto pose = riders_[robot]->client().pose();
    return pose && pose->localized;
  }
  // What the server says of a robot, for a test that fails.
  std::string Told(int robot) {
    const RobotClient& client = riders_[robot]->client();
    const auto ledger = client.ledger();
    const auto pose = client.pose();
    return (pose ? "pose of reason " + std::to_string(static_cast<int>(pose->reason)) : std::string("no pose")) +
           ", session " + std::to_string(static_cast<int>(client.session().phase)) + " " +
           client.session().status.message + ", " + std::to_string(client.restarted()) + " new sessions, settled " +
           (ledger ? std::to_string(ledger->settled_through) + " of " + std::to_string(ledger->last_sequence)
                   : "none") +
           ", " + std::to_string(riders_[robot]->scans()) + " scans";
  }

  const TempDirectory state_;
  bool stores_ = true;
  std::optional<ChildProcess> server_;
  const std::unique_ptr<wire::Bus> bus_;
  sim::Fleet fleet_;
  std::map<int, std::unique_ptr<Rider>> riders_;
  std::map<int, std::map<Stamp, PoseReport>> told_;
  std::map<int, Odometer> set_;
  std::map<int, Pose2> T_shown_odom_, shown_, before_exchange_;
  Stamp now_ = sim::FleetOptions{}.first_stamp;
};

TEST_F(MovedRobots, OneThatWasCarriedWhileTheServerWasDeadIsLostUntilItIsFound) {
  ASSERT_NO_FATAL_FAILURE(Drive(100.0, {0, 1}));
  EXPECT_TRUE(IsLocalized(0)) << Told(0);
  KillServer();
  ASSERT_NO_FATAL_FAILURE(Drive(20.0, {}));
  Set(0, Odometer::kStandsStill);  // Somebody has carried it.
  StartServer();
  const Stamp back = now_;
  ASSERT_NO_FATAL_FAILURE(Drive(60.0, {0, 1}));
  EXPECT_EQ(Wrong(), 0);
  ASSERT_TRUE(FirstPose(0, back));
  EXPECT_FALSE(FirstPose(0, back)->localized);
  EXPECT_TRUE(IsLocalized(0)) << Told(0);
}

// The next server knows nothing, so that it believes the start pose that a client gives.
TEST_F(MovedRobots, OneThatWasCarriedWhileAServerWithoutAStateWasDeadGivesNoStart) {
  stores_ = false;
  KillServer();
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(60.0, {0, 1}));
  EXPECT_TRUE(IsLocalized(0)) << Told(0);
  KillServer();
  ASSERT_NO_FATAL_FAILURE(Drive(20.0, {}));
  Set(0, Odometer::kStandsStill);  // Somebody has carried it.
  Set(1, Odometer::kStartsAtZero);
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(5.0, {0, 1}));
  for (const int robot : {0, 1}) EXPECT_EQ(riders_[robot]->T_map_robot_restarted(), Pose2{}) << robot;
}

TEST_F(MovedRobots, OneThatDrivesOnWhileAServerWithoutAStateIsDeadIsWhereItIs) {
  stores_ = false;
  KillServer();
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(60.0, {0, 1}));
  KillServer();
  StartServer();
  ASSERT_NO_FATAL_FAILURE(Drive(30.0, {0, 1}));
  for (const int robot : {0, 1}) {
    ASSERT_TRUE(riders_[robot]->T_map_robot_restarted()) << robot;
    EXPECT_NE(riders_[robot]->T_map_robot_restarted(), Pose2{}) << robot;
    EXPECT_TRUE(IsLocalized(robot)) << Told(robot);
  }
  EXPECT_EQ(Wrong(), 0);
}

TEST_F(MovedRobots, OdometryThatBeginsAnewPutsNoRobotAtAWrongPlace) {
  ASSERT_NO_FATAL_FAILURE(Drive(100.0, {0, 1}));
  ASSERT_NO_FATAL_FAILURE(Drive(15.0, {1}));
  Set(0, Odometer::kStartsAtZero);  // The robot was off; its client goes on with its session.
  const Stamp back = now_;
  ASSERT_NO_FATAL_FAILURE(Drive(30.0, {0, 1}));
  ASSERT_TRUE(FirstPose(0, back));
  EXPECT_FALSE(FirstPose(0, back)->localized);
  Leave(1);
  KillServer();
  ASSERT_NO_FATAL_FAILURE(Drive(15.0, {}));
  Set(0, Odometer::kStartsAtZero);
  Set(1, Odometer::kStartsAtZero);
  StartServer();
  Ride(1, fleet_.name(1), std::nullopt);  // Another process, which knows nothing.
  ASSERT_NO_FATAL_FAILURE(Drive(60.0, {0, 1}));
  EXPECT_EQ(Wrong(), 0);
  EXPECT_TRUE(IsLocalized(0)) << Told(0);
}

// Two drives were confused, for example by a program that counts them together: neither is where its odometry says.
TEST_F(MovedRobots, WhoExchangedTheirOdometryAreNotPutAtEachOthersPlaces) {
  ASSERT_NO_FATAL_FAILURE(Drive(100.0, {0, 1}));
  for (const bool killed : {false, true}) {
    SCOPED_TRACE(killed ? "the server was killed meanwhile" : "the server goes on");
    if (killed) KillServer();
    // After more than 10 s the first scans would wait for others that confirm the time (jump_confirmations).
    ASSERT_NO_FATAL_FAILURE(Drive(8.0, {}));
    ExchangeOdometry();
    if (killed) StartServer();
    const Stamp back = now_;
    ASSERT_NO_FATAL_FAILURE(Drive(40.0, {0, 1}));
    for (int robot = 0; robot < kRobots; ++robot) {
      ASSERT_TRUE(FirstPose(robot, back));
      EXPECT_FALSE(FirstPose(robot, back)->localized) << robot;
    }
  }
  EXPECT_EQ(Wrong(), 0);
}

TEST_F(MovedRobots, WhoExchangedTheirNamesAreNotPutAtEachOthersPlaces) {
  ASSERT_NO_FATAL_FAILURE(Drive(60.0, {0, 1}));
  Leave(0);
  Leave(1);
  KillServer();
  StartServer();
  const Stamp back = now_;
  Ride(0, fleet_.name(1), std::nullopt);
  Ride(1, fleet_.name(0), std::nullopt);
  ASSERT_NO_FATAL_FAILURE(Drive(60.0, {0, 1}));
  EXPECT_EQ(Wrong(), 0);
  for (int robot = 0; robot < kRobots; ++robot) {
    ASSERT_TRUE(FirstPose(robot, back));
    EXPECT_FALSE(FirstPose(robot, back)->localized);
  }
}

TEST_F(MovedRobots, WhoExchangedTheirNamesAndSayWhereTheyAreBeginThere) {
  ASSERT_NO_FATAL_FAILURE(Drive(30.0, {0, 1}));
  Leave(0);
  Leave(1);
  const Stamp back = now_;
  Ride(0, fleet_.name(1), fleet_.truth(0).back().T_map_robot);
  Ride(1, fleet_.name(0), fleet_.truth(1).back().T_map_robot);
  // A short drive: the start is the pose at the last sample before, not at the first scan, so that the new map is
  // turned.
  ASSERT_NO_FATAL_FAILURE(Drive(8.0, {0, 1}));
  EXPECT_EQ(Wrong(), 0);
  for (int robot = 0; robot < kRobots; ++robot) {
    ASSERT_TRUE(FirstPose(robot, back));
    EXPECT_TRUE(FirstPose(robot, back)->localized);
  }
}

}  // namespace
}  // namespace cairn::client
