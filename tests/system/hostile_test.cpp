// Forged datagrams after which readers and writers ignore each other: the streams of two robots stood still for good,
// while the server said `active`. Now they are noticed, said to be stale, and flow again. `cairn-study hostile` does it
// for longer.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <map>
#include <string>
#include <thread>

#include "client/lib/pose_client.h"
#include "client/lib/query_client.h"
#include "client/lib/robot_client.h"
#include "common/mutex.h"
#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/system/hostile_traffic.h"

namespace cairn::test {
namespace {

using client::QueryClient;
using client::RobotClient;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr char kOdometry[] = "odometry";

// Drives slowly along a wall, ten scans a second, from a thread of its own.
class StreamingRobot {
 public:
  explicit StreamingRobot(const std::string& name) : bus_(MakeBus(name)) {
    SessionRequest request;
    request.robot = name;
    request.site = "hall";
    request.sensors = {"laser"};
    RobotClient::Callbacks callbacks;
    callbacks.pose = [this](const PoseReport&) { ++poses_; };
    client::RobotClientOptions options;
    options.window = 0;
    client_ = Must(RobotClient::Open(*bus_, request, 20.0, std::move(callbacks), options));
    driver_ = std::thread([this] { Drive(); });
  }
  ~StreamingRobot() { Stop(); }

  void Stop() {
    stop_ = true;
    if (driver_.joinable()) driver_.join();
  }
  [[nodiscard]] RobotClient& client() const { return *client_; }
  [[nodiscard]] std::uint64_t scans() const { return scans_; }

  // What has to grow where everything flows: scans and odometry at the server, ledgers and poses here.
  struct Flow {
    std::uint64_t scans = 0;
    std::uint64_t odometry = 0;
    std::uint64_t poses = 0;
  };
  [[nodiscard]] Flow flow() const {
    const auto of = [this](const char* sensor) {
      const auto ledger = client_->ledger(sensor);
      return ledger ? ledger->received : 0;
    };
    return {of("laser"), of(kOdometry), poses_};
  }
  [[nodiscard]] bool FlowsSince(const Flow& before) const {
    const Flow now = flow();
    return now.scans > before.scans && now.odometry > before.odometry && now.poses > before.poses;
  }

 private:
  void Drive() {
    auto next = std::chrono::steady_clock::now();
    for (int step = 0; !stop_; ++step) {
      const Stamp stamp = StampFromSeconds(0.05 * step);
      static_cast<void>(client_->Publish(Odometry{.sequence = 0, .stamp = stamp, .T_odom_robot = {}}));
      if (step % 2 == 1) {
        Scan scan;
        scan.stamp = stamp - 1000;
        scan.angle_first_rad = -1.5;
        scan.angle_step_rad = 3.0 / 180;
        scan.range_min_m = 0.1;
        scan.range_max_m = 10.0;
        scan.ranges_m.assign(180, 2.0F);
        if (client_->Publish(scan)) ++scans_;
      }
      std::this_thread::sleep_until(next += milliseconds(50));
    }
    static_cast<void>(client_->Publish(Odometry{.sequence = 0, .stamp = StampFromSeconds(1e6), .T_odom_robot = {}}));
  }

  const std::unique_ptr<Bus> bus_;
  std::atomic<std::uint64_t> poses_ = 0;
  std::atomic<std::uint64_t> scans_ = 0;
  std::atomic<bool> stop_ = false;
  std::unique_ptr<RobotClient> client_;
  std::thread driver_;
};

// Both ends must notice within 2 s; half a second more is for the wire, and for an observer to find the server.
constexpr milliseconds kSaidWithin{2500};

bool IsSaidStale(const SessionState& state) {
  return state.stale && !state.status.ok();
}

// Whether this is what the server says, and not the robot's client itself.
bool IsTheServers(const SessionState& state) {
  return state.status.message.find("nothing arrives of") != std::string::npos;
}

// When each robot was first called stale, from some moment on. Thread-safe.
class SaidStale {
 public:
  explicit SaidStale(std::chrono::steady_clock::time_point since) : since_(since) {}
  void Add(const std::string& robot) {
    const MutexLock lock(mutex_);
    after_.try_emplace(robot, std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - since_));
  }
  [[nodiscard]] std::map<std::string, milliseconds> after() const {
    const MutexLock lock(mutex_);
    return after_;
  }

 private:
  const std::chrono::steady_clock::time_point since_;
  mutable Mutex mutex_;
  std::map<std::string, milliseconds> after_ CAIRN_GUARDED_BY(mutex_);
};

class Hostile : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(server_.Says(" ready"));
    for (const char* name : {"r1", "r2"}) robots_.push_back(std::make_unique<StreamingRobot>(name));
    ASSERT_TRUE(AllFlow(seconds(20)));
  }

  bool AllFlow(milliseconds deadline) {
    std::vector<StreamingRobot::Flow> before;
    for (const auto& robot : robots_) before.push_back(robot->flow());
    return Eventually(
        [&] {
          for (std::size_t i = 0; i < robots_.size(); ++i) {
            if (!robots_[i]->FlowsSince(before[i])) return false;
          }
          return true;
        },
        deadline);
  }

  // From every participant, as each of its first writers: "all up to `ahead` numbers from now are gone".
  void ForgeNumbersAhead(const std::vector<GuidPrefix>& participants, std::int64_t ahead) {
    for (const GuidPrefix& from : participants) {
      for (std::uint32_t entity = 0x0100; entity <= 0x0a00; entity += 0x0100) {
        for (const std::uint32_t kind : {0x02U, 0x03U}) {
          for (const std::uint16_t port : UnicastPorts(TestDomain(), 6)) {
            cannon_.Send(ForgedHeartbeat(from, entity | kind, ahead, ahead, 100), port);
          }
        }
      }
    }
  }

  // The server's account: every scan arrived once.
  void ExpectNothingLostOrDoubled() {
    for (const auto& robot : robots_) {
      robot->Stop();
      ASSERT_TRUE(Eventually([&] {
        const auto ledger = robot->client().ledger("laser");
        return ledger && ledger->last_sequence >= robot->scans() && ledger->received >= robot->scans();
      })) << robot->client().ledger("laser")->received
          << " of " << robot->scans();
      const Ledger ledger = *robot->client().ledger("laser");
      EXPECT_EQ(ledger.received, robot->scans());
      EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kLostOnWire)], 0U);
      EXPECT_EQ(robot->client().restarted(), 0);
    }
  }

  ChildProcess server_{{CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--state", "none"}};
  std::vector<std::unique_ptr<StreamingRobot>> robots_;
  const Cannon cannon_;
};

TEST_F(Hostile, NumbersThatAreFarAheadChangeNothing) {
  const auto participants = OverhearParticipants(TestDomain(), seconds(4));
  ASSERT_GE(participants.size(), 3U);
  ForgeNumbersAhead(participants, std::int64_t{1} << 29);
  EXPECT_TRUE(AllFlow(seconds(2)));
  for (const auto& robot : robots_) EXPECT_EQ(robot->client().renewed(), 0);
  ExpectNothingLostOrDoubled();
}

TEST_F(Hostile, AStreamThatTakesNothingIsStaleAndFlowsAgainWithinFiveSeconds) {
  const auto viewer_bus = MakeBus("viewer");
  const auto viewer = Must(client::PoseClient::Create(*viewer_bus, "r1"));
  ASSERT_TRUE(Eventually([&] { return viewer->Next(0.1).has_value(); }));
  const auto participants = OverhearParticipants(TestDomain(), seconds(4));
  ASSERT_GE(participants.size(), 3U);
  const auto queries_bus = MakeBus("operator");
  const auto queries = Must(QueryClient::Create(*queries_bus, {.timeout_s = 20.0}));
  ASSERT_EQ(Must(queries->Robots()).size(), 2U);
  const auto ahead =
      static_cast<std::int64_t>(robots_[0]->flow().odometry + 300);  // Plausible: the guard lets it pass.
  ForgeNumbersAhead(participants, ahead);
  const auto end = std::chrono::steady_clock::now();
  // Somebody who came after the forgeries: what the server says, and how long after the end of the forgeries.
  SaidStale server_said(end);
  const auto observer_bus = MakeBus("observer");
  const auto observer = Must(observer_bus->Subscribe<SessionState>([&](SessionState&& state) {
    if (IsSaidStale(state)) server_said.Add(state.robot);
  }));
  SaidStale robots_said(end);
  EXPECT_TRUE(Eventually(
      [&] {
        for (const auto& robot : robots_) {
          const SessionState state = robot->client().session();
          if (IsSaidStale(state) && !IsTheServers(state)) robots_said.Add(state.robot);
        }
        return robots_said.after().size() == robots_.size();
      },
      kSaidWithin));
  EXPECT_TRUE(Eventually([&] { return AllFlow(milliseconds(500)); }, milliseconds(5000)));
  EXPECT_LT(std::chrono::steady_clock::now() - end, seconds(5));
  // The viewer can notice only that poses are missing when the robots have new ones.
  while (viewer->Next(0.0)) {
  }
  EXPECT_TRUE(Eventually([&] { return viewer->Next(0.1).has_value(); }));
  EXPECT_TRUE(Eventually([&] {
    for (const auto& robot : robots_) {
      if (robot->client().session().stale) return false;
    }
    return true;
  }));
  // Both robots were told (above). Who came later may have come when one of them was flowing again.
  const auto after = server_said.after();
  EXPECT_FALSE(after.empty());
  for (const auto& [robot, time] : after) EXPECT_LE(time, kSaidWithin) << "the server, of " << robot;
  for (const RobotStatus& robot : Must(queries->Robots())) {
    EXPECT_EQ(robot.session.phase, SessionPhase::kActive);
    EXPECT_FALSE(robot.session.stale) << robot.session.status.message;
  }
  ExpectNothingLostOrDoubled();
}

}  // namespace
}  // namespace cairn::test
