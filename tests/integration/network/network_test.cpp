// A server and two robots on two machines, with a cable between them that loses, delays and reorders what they send, or
// is cut: the streams go on by themselves, the session stays, and the ledger says what became of every scan.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <thread>

#include "client/lib/robot_client.h"
#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "tests/child_process.h"
#include "tests/integration/network/faulty_link.h"
#include "tests/integration/network/network_namespace.h"
#include "tests/loopback.h"

namespace cairn::test {
namespace {

using client::RobotClient;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;

constexpr char kServerAddress[] = "10.77.0.1";
constexpr char kRobotAddress[] = "10.77.0.2";
constexpr int kRobots = 2;
constexpr double kWrong_m = 0.5;
// Longest time until poses come again: over a network that is well, and over one that is still bad. There discovery may
// fail, and the pauses between two attempts double from 2 s on.
constexpr milliseconds kRecovery{10'000};
constexpr milliseconds kRecoveryWhileBad{40'000};

WireOptions RobotOptions() {
  WireOptions options = LoopbackOptions();
  options.interfaces = {kRobotAddress};
  return options;
}

// A robot on a participant of its own, and the poses it was told.
class NetworkRobot {
 public:
  NetworkRobot(const std::string& name, const Pose2& start) : bus_(MakeBus(name, RobotOptions())) {
    SessionRequest request;
    request.robot = name;
    request.site = "office";
    request.sensors = {"laser"};
    request.has_start = true;
    request.T_map_robot_start = start;
    RobotClient::Callbacks callbacks;
    callbacks.pose = [this](const PoseReport& pose) {
      const MutexLock lock(mutex_);
      poses_[pose.stamp] = pose;
    };
    client::RobotClientOptions options;
    options.window = 0;  // It drives on, whatever the network does.
    client_ = Must(RobotClient::Open(*bus_, request, 20.0, std::move(callbacks), options));
    session_ = client_->session().session;
  }

  void Take(LogRecord record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      EXPECT_TRUE(client_->Publish(*odometry));
      return;
    }
    EXPECT_TRUE(client_->Publish(std::get<Scan>(record)));
    newest_scan_ = std::get<Scan>(record).stamp;
    ++scans_;
  }

  [[nodiscard]] RobotClient& client() const { return *client_; }
  [[nodiscard]] SessionToken first_session() const { return session_; }
  [[nodiscard]] std::uint64_t scans() const { return scans_; }
  [[nodiscard]] Stamp newest_scan() const { return newest_scan_; }
  [[nodiscard]] bool HasPoseAfter(Stamp stamp) {
    const MutexLock lock(mutex_);
    return !poses_.empty() && poses_.rbegin()->first > stamp;
  }
  [[nodiscard]] std::map<Stamp, PoseReport> poses() {
    const MutexLock lock(mutex_);
    return poses_;
  }

 private:
  const std::unique_ptr<Bus> bus_;
  SessionToken session_ = 0;
  std::atomic<std::uint64_t> scans_ = 0;
  std::atomic<Stamp> newest_scan_ = 0;
  Mutex mutex_;
  std::map<Stamp, PoseReport> poses_ CAIRN_GUARDED_BY(mutex_);
  std::unique_ptr<RobotClient> client_;
};

class Network : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* address : {kServerAddress, kRobotAddress}) {
      auto made = NetworkNamespace::Create(address);
      if (!made) GTEST_SKIP() << "SKIPPED: this user " << made.error().message;
      machines_.push_back(std::make_unique<NetworkNamespace>(std::move(*made)));
    }
    link_ = std::make_unique<FaultyLink>(machines_[0]->frames(), machines_[1]->frames(), 1);
    machines_[0]->Inside([this] { StartServer(); });
    ASSERT_TRUE(server_->Says(" ready")) << server_->Wait().output;
    machines_[1]->Inside([this] { StartRobots(); });
    ASSERT_GE(SecondsUntilPoses(seconds(20)), 0.0);
  }
  void TearDown() override { StopDriving(); }

  // Applies the faults until so much time has passed, during which the robots drive on.
  void Disturb(const LinkFaults& faults, seconds time) {
    link_->Set(faults);
    std::vector<Stamp> since;
    for (const auto& robot : robots_) since.push_back(robot->newest_scan());
    const auto end = Clock::now() + time;
    ASSERT_TRUE(Eventually([&] { return Clock::now() >= end; }, time + seconds(5)));
    if (!faults.cut) return;
    for (std::size_t i = 0; i < robots_.size(); ++i)
      EXPECT_FALSE(robots_[i]->HasPoseAfter(since[i] + StampFromSeconds(0.2))) << "the network is not cut";
  }

  void ExpectPosesAgain(const LinkFaults& now, const std::string& when) {
    link_->Set(now);
    const double flows_s = SecondsUntilPoses(now.loss > 0.0 ? kRecoveryWhileBad : kRecovery);
    fmt::print("poses flow again {:.2f} s after {}\n", flows_s, when);
    EXPECT_GE(flows_s, 0.0) << "no poses";
  }

  // The network is well again: everything has to recover, and to be accounted for.
  void ExpectRecovery() {
    ExpectPosesAgain({}, "the network is well again");
    fmt::print("{} frames carried, {} lost\n", link_->carried(), link_->lost());
    StopDriving();
    for (int i = 0; i < kRobots; ++i) {
      ExpectEveryScanExplained(i);
      ExpectNeverAtAWrongPlace(i);
    }
  }

 private:
  void StartServer() {
    server_.reset(new ChildProcess({CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--set",
                                    fmt::format("wire.interfaces={}", kServerAddress), "--set", "slam.particles=20"}));
  }

  void StartRobots() {
    sim::FleetOptions options;
    options.robots = kRobots;
    options.laser.beams = 181;
    fleet_.emplace(Must(sim::Fleet::Create(Must(sim::OpenSurroundings("office")), options)));
    for (int i = 0; i < kRobots; ++i)
      robots_.push_back(std::make_unique<NetworkRobot>(fleet_->name(i), fleet_->T_map_robot_start(i)));
    driver_ = std::thread([this, first = options.first_stamp] { Drive(first); });
  }

  // In real time, until it is told to stop; each robot ends with odometry after its last scan.
  void Drive(Stamp first) {
    const auto start = Clock::now();
    std::optional<Stamp> end;
    std::array<bool, kRobots> ended{};
    while (std::count(ended.begin(), ended.end(), true) < kRobots) {
      sim::FleetRecord next = fleet_->Next();
      const bool scan = std::holds_alternative<Scan>(next.record);
      const Stamp stamp = std::visit([](const auto& value) { return value.stamp; }, next.record);
      const auto robot = static_cast<std::size_t>(next.robot);
      if (stop_ && !end) end = stamp;
      if (end && (scan || ended.at(robot))) continue;
      std::this_thread::sleep_until(start + std::chrono::nanoseconds(stamp - first));
      robots_[robot]->Take(std::move(next.record));
      ended.at(robot) = end.has_value();
    }
  }

  void StopDriving() {
    stop_ = true;
    if (driver_.joinable()) driver_.join();
  }

  // From now until each robot has the pose of a scan that it takes from now on; negative where that takes too long.
  double SecondsUntilPoses(milliseconds deadline) {
    const auto start = Clock::now();
    std::vector<Stamp> since;
    for (const auto& robot : robots_) since.push_back(robot->newest_scan());
    const bool flows = Eventually(
        [&] {
          for (std::size_t i = 0; i < robots_.size(); ++i) {
            if (!robots_[i]->HasPoseAfter(since[i])) return false;
          }
          return true;
        },
        deadline);
    return flows ? std::chrono::duration<double>(Clock::now() - start).count() : -1.0;
  }

  void ExpectEveryScanExplained(int i) {
    NetworkRobot& robot = *robots_[static_cast<std::size_t>(i)];
    const std::uint64_t sent = robot.scans();
    EXPECT_TRUE(robot.client().WaitSettled(20.0));
    ASSERT_TRUE(Eventually([&] {
      const auto now = robot.client().ledger();
      return now && now->last_sequence >= sent && now->settled_through >= sent;
    }));
    const Ledger ledger = *robot.client().ledger();
    fmt::print("robot {}: {} sent, {} used, {} dropped; {} samples sent again, joined anew {} times\n", i + 1, sent,
               ledger.used, ledger.dropped_total(), robot.client().resent(), robot.client().renewed());
    EXPECT_EQ(ledger.last_sequence, sent);
    EXPECT_EQ(ledger.used + ledger.dropped_total() + ledger.waiting, sent);
    EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kLostOnWire)], 0U);
    EXPECT_GT(ledger.used, 0U);
    EXPECT_EQ(ledger.session, robot.first_session());
    EXPECT_EQ(robot.client().session().session, robot.first_session());
    EXPECT_EQ(robot.client().restarted(), 0);
    EXPECT_EQ(robot.client().displaced(), 0U);
    EXPECT_TRUE(Eventually([&] { return !robot.client().session().stale; })) << robot.client().session().status.message;
  }

  void ExpectNeverAtAWrongPlace(int i) {
    const auto poses = robots_[static_cast<std::size_t>(i)]->poses();
    int localized = 0;
    for (const StampedPose& truth : fleet_->truth(i)) {
      const auto told = poses.find(truth.stamp);
      if (told == poses.end() || !told->second.localized) continue;
      ++localized;
      EXPECT_LT((told->second.T_map_robot.translation() - truth.T_map_robot.translation()).norm(), kWrong_m);
    }
    EXPECT_GT(localized, 0);
  }

  std::vector<std::unique_ptr<NetworkNamespace>> machines_;
  std::unique_ptr<FaultyLink> link_;
  std::unique_ptr<ChildProcess> server_;
  std::optional<sim::Fleet> fleet_;
  std::vector<std::unique_ptr<NetworkRobot>> robots_;
  std::atomic<bool> stop_ = false;
  std::thread driver_;
};

TEST_F(Network, LosesATenthOfTheFrames) {
  Disturb({.loss = 0.1}, seconds(5));
  ExpectRecovery();
}

TEST_F(Network, DelaysAndReordersFrames) {
  Disturb({.delay_s = 0.1, .spread_s = 0.05}, seconds(5));
  ExpectRecovery();
}

// The robots' liveliness ends after 1 s, and the participants remember each other for 3 s.
TEST_F(Network, IsCutForLongerThanTheLivelinessLease) {
  Disturb({.cut = true}, seconds(2));
  ExpectRecovery();
}

TEST_F(Network, IsCutForLongerThanParticipantsRememberEachOther) {
  Disturb({.cut = true}, seconds(5));
  ExpectRecovery();
}

TEST_F(Network, IsCutWhileItLosesDelaysAndReordersFrames) {
  const LinkFaults bad{.loss = 0.1, .delay_s = 0.1, .spread_s = 0.05};
  LinkFaults cut = bad;
  cut.cut = true;
  Disturb(bad, seconds(3));
  Disturb(cut, seconds(5));
  ExpectPosesAgain(bad, "the network is no longer cut");
  ExpectRecovery();
}

}  // namespace
}  // namespace cairn::test
