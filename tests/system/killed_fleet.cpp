#include "tests/system/killed_fleet.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <stdexcept>

#include "common/mutex.h"
#include "common/sensor/trajectory.h"
#include "common/service/pose_report.h"
#include "common/wire/bus.h"
#include "tests/child_process.h"
#include "tests/eventually.h"
#include "tests/must.h"
#include "tests/test_domain.h"

namespace cairn::test {
namespace {

using Clock = std::chrono::steady_clock;
using nlohmann::json;

constexpr double kWrong_m = 0.5, kWrong_rad = 0.5;
constexpr std::chrono::seconds kLongest{600};

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

json ObjectPrintedBy(const ChildProcess::Outcome& outcome) {
  const std::size_t start = outcome.output.rfind("\n{");
  const std::size_t begin = start == std::string::npos ? 0 : start + 1;
  json object = json::parse(outcome.output.substr(begin, outcome.output.find('\n', begin) - begin), nullptr, false);
  if (outcome.exit_code != 0 || !object.is_object())
    throw std::runtime_error(fmt::format("exit code {}: {}", outcome.exit_code, outcome.output));
  return object;
}

using Trajectories = std::map<std::string, Trajectory>;

// Everything that is told of the robots' poses, compared with the truth and with what another server told.
class PoseWatcher {
 public:
  struct Counts {
    std::uint64_t poses = 0;
    std::uint64_t beside_truth = 0;  // Called localized.
    std::uint64_t beside_other = 0;  // Called localized.
    double farthest_m = 0.0;         // From the truth, called localized.
    std::vector<std::string> first_beside_truth, first_beside_other;
  };

  // `other`: may be empty.
  PoseWatcher(Trajectories truth, Trajectories other) : truth_(std::move(truth)), other_(std::move(other)) {
    wire::WireOptions options;
    options.domain = TestDomain();
    bus_ = Must(wire::Bus::Create(options, "watcher"));
    poses_ = Must(bus_->Subscribe<PoseReport>([this](PoseReport&& pose) { Take(pose); }, {}));
  }
  ~PoseWatcher() { poses_.reset(); }

  [[nodiscard]] Counts counts() {
    const MutexLock lock(mutex_);
    return counts_;
  }
  // The poses that were told while the robots drove, each at its time.
  [[nodiscard]] Trajectories told() {
    const MutexLock lock(mutex_);
    Trajectories told;
    for (const auto& [robot, poses] : told_)
      for (const auto& [stamp, pose] : poses) told[robot].push_back({stamp, pose});
    return told;
  }
  // How many robots have had a pose of the newest generation.
  [[nodiscard]] int RobotsWithPoses() {
    const MutexLock lock(mutex_);
    return static_cast<int>(std::count_if(newest_.begin(), newest_.end(),
                                          [now = generation_](const auto& one) { return one.second == now; }));
  }
  // From now on only poses of a later generation count.
  void Killed() {
    const MutexLock lock(mutex_);
    ++generation_;
  }

 private:
  // Where the robot was; nothing if that is not known.
  static std::optional<Pose2> There(const Trajectories& right, const PoseReport& pose) {
    const auto path = right.find(pose.robot);
    if (path == right.end()) return std::nullopt;
    return PoseOn(path->second, pose.stamp, 1.0);
  }
  static double Distance(const PoseReport& pose, const Pose2& there) {
    return (pose.T_map_robot.translation() - there.translation()).norm();
  }
  static bool IsBeside(const Trajectories& right, const PoseReport& pose) {
    const auto there = There(right, pose);
    return there && (Distance(pose, *there) > kWrong_m ||
                     std::abs(AngleDiff(pose.T_map_robot.theta, there->theta)) > kWrong_rad);
  }

  void Take(const PoseReport& pose) {
    const MutexLock lock(mutex_);
    ++counts_.poses;
    generation_ = std::max(generation_, pose.generation);
    newest_[pose.robot] = std::max(newest_[pose.robot], pose.generation);
    told_[pose.robot][pose.stamp] = pose.T_map_robot;
    if (!pose.localized) return;
    if (const auto there = There(truth_, pose))
      counts_.farthest_m = std::max(counts_.farthest_m, Distance(pose, *there));
    if (IsBeside(truth_, pose)) {
      ++counts_.beside_truth;
      Describe(pose, truth_, counts_.first_beside_truth);
    }
    if (IsBeside(other_, pose)) {
      ++counts_.beside_other;
      Describe(pose, other_, counts_.first_beside_other);
    }
  }
  static void Describe(const PoseReport& pose, const Trajectories& right, std::vector<std::string>& described) {
    constexpr std::size_t kMost = 20;
    if (described.size() >= kMost) return;
    const Pose2& is = pose.T_map_robot;
    const Pose2 should = There(right, pose).value_or(Pose2{});
    described.push_back(fmt::format(
        "{} at {:.2f} s is told to be at ({:.2f}, {:.2f}, {:.2f}) instead of ({:.2f}, {:.2f}, {:.2f}): {}, score "
        "{:.2f}, sigma ({:.2f}, {:.2f}, {:.2f}), generation {}, map epoch {}",
        pose.robot, static_cast<double>(pose.stamp) / kNanosPerSecond, is.x, is.y, is.theta, should.x, should.y,
        should.theta, PoseReasonName(pose.reason), pose.score, std::sqrt(pose.covariance(0, 0)),
        std::sqrt(pose.covariance(1, 1)), std::sqrt(pose.covariance(2, 2)), pose.generation, pose.map_epoch));
  }

  const Trajectories truth_, other_;
  Mutex mutex_;
  Counts counts_ CAIRN_GUARDED_BY(mutex_);
  std::map<std::string, std::map<Stamp, Pose2>> told_ CAIRN_GUARDED_BY(mutex_);
  Generation generation_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::map<std::string, Generation> newest_ CAIRN_GUARDED_BY(mutex_);
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<wire::Subscription> poses_;
};

class Drive {
 public:
  explicit Drive(const KilledFleetOptions& options) : options_(options), random_(options.seed) {
    MakeLogs();
    for (int i = 1; i <= options.robots; ++i) {
      const std::string robot = "robot" + std::to_string(i);
      truth_[robot] = Must(ReadTum(options_.directory / "truth" / (robot + ".tum")));
    }
  }

  KilledFleetOutcome Run() {
    KilledFleetOutcome outcome;
    std::optional<PoseWatcher> watcher(std::in_place, truth_, Trajectories{});
    const auto undisturbed = Replay("undisturbed", *watcher, nullptr);
    outcome.undisturbed_poses = watcher->counts().poses;
    outcome.undisturbed_beside_truth = watcher->counts().beside_truth;
    outcome.undisturbed_farthest_m = watcher->counts().farthest_m;
    const Trajectories told = watcher->told();
    watcher.emplace(truth_, told);
    const auto killed = Replay("killed", *watcher, &outcome);
    outcome.poses = watcher->counts().poses;
    outcome.beside_truth = watcher->counts().beside_truth;
    outcome.farthest_m = watcher->counts().farthest_m;
    outcome.wrongly_localized = options_.orders ? outcome.beside_truth : watcher->counts().beside_other;
    outcome.wrong = options_.orders ? watcher->counts().first_beside_truth : watcher->counts().first_beside_other;
    for (const auto& [robot, calm] : undisturbed) {
      const Result& other = killed.at(robot);
      outcome.sent += other.sent;
      outcome.lost += calm.used > other.used ? calm.used - other.used : 0;
      outcome.doubled += other.used > calm.used ? other.used - calm.used : 0;
      outcome.lost += static_cast<std::uint64_t>(std::max<std::int64_t>(0, other.unexplained));
      outcome.doubled += static_cast<std::uint64_t>(std::max<std::int64_t>(0, -other.unexplained));
      const std::string difference = options_.orders ? std::string() : DifferenceOf(calm.path, other.path);
      outcome.paths_that_differ += difference.empty() ? 0 : 1;
      if (!difference.empty() || other.used != calm.used || other.unexplained != 0)
        outcome.differences.push_back(robot + ": " + difference + "; " + other.account);
    }
    return outcome;
  }

 private:
  struct Result {
    std::uint64_t sent = 0, used = 0;
    std::int64_t unexplained = 0;  // Scans sent and in no account; negative where more were counted than sent.
    std::string account;
    Trajectory path;
  };

  // Empty: the paths are the same in every digit that `cairn path` prints.
  static std::string DifferenceOf(const Trajectory& a, const Trajectory& b) {
    const auto [x, y] =
        std::mismatch(a.begin(), a.end(), b.begin(), b.end(), [](const StampedPose& p, const StampedPose& q) {
          return p.stamp == q.stamp && p.T_map_robot == q.T_map_robot;
        });
    if (x == a.end() && y == b.end()) return {};
    if (x == a.end() || y == b.end()) return fmt::format("paths of {} and {} poses", a.size(), b.size());
    return fmt::format("paths of {} and {} poses differ from pose {} on, there by {:.6f} m", a.size(), b.size(),
                       x - a.begin(), (x->T_map_robot.translation() - y->T_map_robot.translation()).norm());
  }

  [[nodiscard]] std::string Domain() const { return std::to_string(TestDomain()); }
  std::unique_ptr<ChildProcess> Start(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), options_.cairn);
    arguments.insert(arguments.end(), {"--domain", Domain(), "--json", "--timeout", "30"});
    return std::make_unique<ChildProcess>(std::move(arguments));
  }

  void MakeLogs() const {
    static_cast<void>(ObjectPrintedBy(
        Start({"sim", "--no-stream", "--world", "office", "--robots", std::to_string(options_.robots), "--hz", "10",
               "--beams", "181", "--seconds", fmt::format("{}", options_.seconds), "--log-dir",
               (options_.directory / "logs").string(), "--truth-dir", (options_.directory / "truth").string()})
            ->Wait(kLongest)));
  }

  void LaunchServer(const std::string& state) {
    std::vector<std::string> program = {options_.cairnd, "--domain", Domain(), "--state",
                                        (options_.directory / state).string()};
    std::vector<std::string> settings = {"slam.particles=20", "robots.checkpoint_entries=100", "maps.max_versions=64"};
    settings.insert(settings.end(), options_.settings.begin(), options_.settings.end());
    for (std::string& setting : settings) program.insert(program.end(), {"--set", std::move(setting)});
    server_ = std::make_unique<ChildProcess>(std::move(program));
  }

  void StartServer(const std::string& state) {
    LaunchServer(state);
    if (!server_->Says(" ready")) throw std::runtime_error("cairnd does not start: " + server_->Wait().output);
  }

  std::vector<std::unique_ptr<ChildProcess>> StartRobots(bool at_once) {
    std::vector<std::unique_ptr<ChildProcess>> robots;
    for (const auto& [robot, truth] : truth_) {
      const Pose2& start = truth.front().T_map_robot;
      std::vector<std::string> replay = {"replay",  (options_.directory / "logs" / (robot + ".log")).string(),
                                         "--site",  "office",
                                         "--robot", robot,
                                         "--start", fmt::format("{:.9f},{:.9f},{:.9f}", start.x, start.y, start.theta)};
      // How fast the scans come changes nothing.
      if (at_once) replay.push_back("--fast");
      if (!at_once) replay.insert(replay.end(), {"--rate", fmt::format("{}", options_.rate)});
      robots.push_back(Start(std::move(replay)));
    }
    return robots;
  }

  static int Driving(const std::vector<std::unique_ptr<ChildProcess>>& robots) {
    return static_cast<int>(std::count_if(robots.begin(), robots.end(), [](const auto& robot) {
      return robot->RunningAfter(std::chrono::milliseconds(0));
    }));
  }

  void Kill(const std::vector<std::unique_ptr<ChildProcess>>& robots, PoseWatcher& watcher,
            KilledFleetOutcome& outcome) {
    const auto kill_within = [&](double most_s) {
      // The moment of the kill is random; it is not a wait for anything but the end of the drive.
      std::uniform_real_distribution<double> wait_s(0.0, most_s);
      static_cast<void>(Eventually([&] { return Driving(robots) == 0; },
                                   std::chrono::milliseconds(std::lround(1000.0 * wait_s(random_)))));
      server_->Signal(SIGKILL);
      server_->Wait();
      watcher.Killed();
      ++outcome.kills;
    };
    kill_within(options_.most_up_s);
    // Some servers are killed before they are ready, while they restore.
    if (outcome.kills % 3 == 0 && outcome.kills < options_.kills) {
      LaunchServer("killed");
      kill_within(options_.most_starting_s);
      ++outcome.killed_starting;
    }
    const auto start = Clock::now();
    StartServer("killed");
    outcome.ready_s.push_back(SecondsSince(start));
    if (outcome.kills % 4 != 0) return;  // Most kills do not wait until everybody is back.
    static_cast<void>(Eventually([&] { return watcher.RobotsWithPoses() >= Driving(robots); }));
    if (Driving(robots) == options_.robots) outcome.tracking_s.push_back(SecondsSince(start));
  }

  // Kills where there is an outcome to count into.
  std::map<std::string, Result> Replay(const std::string& state, PoseWatcher& watcher, KilledFleetOutcome* outcome) {
    StartServer(state);
    const auto robots = StartRobots(outcome == nullptr);
    std::optional<KilledOrders> orders;
    if (outcome != nullptr && options_.orders) orders.emplace("office", options_.seed);
    while (outcome != nullptr && outcome->kills < options_.kills && Driving(robots) == options_.robots)
      Kill(robots, watcher, *outcome);
    std::map<std::string, Result> results;
    auto process = robots.begin();
    for (const auto& [robot, truth] : truth_) {
      const json account = ObjectPrintedBy((*process++)->Wait(kLongest));
      Result& result = results[robot];
      result.sent = account.at("sent");
      result.used = account.at("used");
      result.unexplained = account.at("unexplained");
      result.account = ObjectPrintedBy(Start({"status", robot})->Wait(kLongest)).dump();
      if (options_.ends) static_cast<void>(ObjectPrintedBy(Start({"session", "end", robot})->Wait(kLongest)));
      const std::string file = (options_.directory / (state + "-" + robot + ".tum")).string();
      static_cast<void>(ObjectPrintedBy(Start({"path", robot, "-o", file})->Wait(kLongest)));
      result.path = Must(ReadTum(file));
    }
    if (orders) outcome->orders = orders->Finish();
    server_->Signal(SIGTERM);
    if (const auto ended = server_->Wait(); ended.exit_code != 0) throw std::runtime_error("cairnd: " + ended.output);
    return results;
  }

  const KilledFleetOptions options_;
  std::mt19937_64 random_;
  Trajectories truth_;
  std::unique_ptr<ChildProcess> server_;
};

}  // namespace

KilledFleetOutcome RunKilledFleet(const KilledFleetOptions& options) {
  return Drive(options).Run();
}

}  // namespace cairn::test
