// How long a server that was killed takes until it answers again, and until its robots have new poses: eight robots of
// which it knows an hour each, and which are connected.
#include "tests/studies/kills/restart.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <thread>
#include <vector>

#include "tests/eventually.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/kills/returning_robot.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kRobots = 8;
constexpr std::chrono::seconds kLongest{60};
// Before the unit (deploy/systemd) starts a server again.
constexpr std::chrono::milliseconds kRestartPause{100};

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::string RobotName(int robot) {
  return "robot" + std::to_string(robot + 1);
}

std::vector<std::string> OnDomain(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), {"--domain", std::to_string(test::TestDomain())});
  return arguments;
}

std::unique_ptr<ChildProcess> StartServer(const fs::path& state) {
  return std::make_unique<ChildProcess>(OnDomain({ProgramPath("cairnd"), "--state", state.string()}));
}

// Drives the robots through a building and sends their logs as fast as a server takes them, which is killed then.
void MakeState(const fs::path& place, double seconds, StudyContext& context) {
  const fs::path logs = place / "logs", new_logs = place / "new-logs", unfinished = place / "unfinished";
  fs::remove_all(unfinished);
  const auto cairn = [](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), ProgramPath("cairn"));
    return std::make_unique<ChildProcess>(OnDomain(std::move(arguments)));
  };
  if (!fs::exists(logs)) {
    static_cast<void>(
        PrintedBy(cairn({"sim", "--no-stream", "--world", "building", "--robots", std::to_string(kRobots), "--hz", "10",
                         "--seconds", std::to_string(seconds), "--log-dir", new_logs.string(), "--json"})
                      ->Wait(LiveServer::kDeadline)));
    fs::rename(new_logs, logs);
  }
  context.report.Progress("logs of " + Number(seconds, 0) + " s");
  const auto server = StartServer(unfinished);
  if (!server->Says(" ready")) throw std::runtime_error("cairnd does not start: " + server->Wait().output);
  std::vector<std::unique_ptr<ChildProcess>> robots;
  for (int robot = 0; robot < kRobots; ++robot)
    robots.push_back(cairn({"replay", (logs / (RobotName(robot) + ".log")).string(), "--site", "lab", "--robot",
                            RobotName(robot), "--fast", "--json"}));
  for (const auto& robot : robots) static_cast<void>(PrintedBy(robot->Wait(LiveServer::kDeadline)));
  server->Signal(SIGKILL);
  server->Wait();
  fs::rename(unfinished, place / "state");
}

// Asks until the answer is there; the time since `start`.
template <typename Ask>
double TimeUntil(Clock::time_point start, const Ask& ask) {
  while (!ask()) {
    if (Clock::now() - start > kLongest) throw std::runtime_error("the server does not answer after its restart");
  }
  return SecondsSince(start);
}

bool HasTiles(client::QueryClient& queries) {
  client::TileQuery query;
  query.site = "lab";
  const auto answer = queries.Tiles(query);
  return answer && !answer->tiles.empty();
}

bool HasAllPoses(client::QueryClient& queries) {
  const auto robots = queries.Robots();
  if (!robots || robots->size() < static_cast<std::size_t>(kRobots)) return false;
  for (const RobotStatus& robot : *robots)
    if (robot.pose.stamp == 0) return false;
  return true;
}

using Robots = std::vector<std::unique_ptr<ReturningRobot>>;

// When the last of the robots had its pose; nothing if one has none yet.
std::optional<Clock::time_point> AllBack(const Robots& robots) {
  Clock::time_point last{};
  for (const auto& robot : robots) {
    const auto back = robot->back();
    if (!back) return std::nullopt;
    last = std::max(last, *back);
  }
  return last;
}

}  // namespace

RestartTimes MeasureRestarts(StudyContext& context) {
  const TempDirectory temporary;
  const fs::path place =
      (context.report.directory().empty() ? temporary.path() : fs::absolute(context.report.directory())) /
      (context.quick ? "restart-quick" : "restart");
  fs::create_directories(place);
  if (!fs::exists(place / "state")) MakeState(place, context.Pick(3600.0, 30.0), context);
  RestartTimes times;
  for (const auto& file : fs::directory_iterator(place / "state")) times.state_bytes += fs::file_size(file);
  wire::WireOptions wire;
  wire.domain = test::TestDomain();
  const auto bus = wire::Bus::Create(wire, "restart");
  if (!bus) throw std::runtime_error(bus.error().message);
  const fs::path state = temporary / "state";
  fs::copy(place / "state", state, fs::copy_options::recursive);
  auto server = StartServer(state);
  if (!server->Says(" ready")) throw std::runtime_error("cairnd does not start: " + server->Wait().output);
  Robots robots;
  for (int robot = 0; robot < kRobots; ++robot)
    robots.push_back(
        std::make_unique<ReturningRobot>(**bus, RobotName(robot), "lab", place / "logs" / (RobotName(robot) + ".log")));
  const std::jthread publisher([&robots](const std::stop_token& stop) {
    for (auto next = Clock::now(); !stop.stop_requested(); next += std::chrono::milliseconds(100)) {
      for (const auto& robot : robots) robot->Publish();
      std::this_thread::sleep_until(next);
    }
  });
  const auto all_back = [&robots] { return AllBack(robots).has_value(); };
  if (!test::Eventually(all_back, kLongest)) throw std::runtime_error("the robots have no poses");
  const auto all_stored = [&robots] {
    return std::ranges::all_of(robots, [](const auto& robot) { return robot->stored(); });
  };
  if (!test::Eventually(all_stored, kLongest)) throw std::runtime_error("the sessions of the robots are not stored");
  std::mt19937_64 random(context.seed);
  const int kills = context.runs > 0 ? context.runs : context.Pick(1000, 3);
  for (int kill = 0; kill < kills; ++kill) {
    for (const auto& robot : robots) robot->Expect();
    const auto queries = client::QueryClient::Create(**bus, {.timeout_s = 0.3});
    if (!queries) throw std::runtime_error(queries.error().message);
    const auto start = Clock::now();
    server->Signal(SIGKILL);
    server->Wait();
    std::this_thread::sleep_for(kRestartPause);
    server = StartServer(state);
    times.tiles_s.push_back(TimeUntil(start, [&] { return HasTiles(**queries); }));
    times.poses_s.push_back(TimeUntil(start, [&] { return HasAllPoses(**queries); }));
    if (!test::Eventually(all_back, kLongest)) throw std::runtime_error("a robot has no pose after a restart");
    times.new_poses_s.push_back(std::chrono::duration<double>(*AllBack(robots) - start).count());
    constexpr int kPerLine = 50;
    if (kill % kPerLine == kPerLine - 1) {
      const auto median = [](const std::vector<double>& values) {
        std::vector<double> newest(values.end() - kPerLine, values.end());
        std::ranges::nth_element(newest, newest.begin() + kPerLine / 2);
        return Number(newest[kPerLine / 2], 2);
      };
      context.report.Progress(std::to_string(kill + 1) + " kills; median of the last ones: tiles " +
                              median(times.tiles_s) + " s, new poses " + median(times.new_poses_s) + " s");
    }
    // The moment of the kill is random.
    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 300));
  }
  for (const auto& robot : robots) times.new_sessions += robot->restarted();
  return times;
}

}  // namespace cairn::studies
