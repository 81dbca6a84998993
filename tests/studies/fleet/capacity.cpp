#include "tests/studies/fleet/capacity.h"

#include <sched.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/studies/fleet/live_server.h"
#include "tests/studies/stopwatch.h"
#include "tests/temp_directory.h"

namespace cairn::studies {
namespace {

constexpr double kMostCarriedLatencyMs = 50.0;  // Scan published to pose received, of 99 in 100 scans.
constexpr double kLeastPace = 0.99;             // Share of real time at which the robots were simulated.
constexpr int kWantedRobots = 200;
constexpr double kWantedMibEach = 3.0;

// All threads of the process, and those that they start later, run on this core only.
void PinToCore(const std::string& pid, int core) {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  CPU_SET(core, &cores);
  for (const auto& thread : std::filesystem::directory_iterator("/proc/" + pid + "/task")) {
    const int id = std::stoi(thread.path().filename().string());
    // A thread may have ended meanwhile.
    if (sched_setaffinity(id, sizeof(cores), &cores) != 0 && errno != ESRCH)
      throw std::runtime_error("a thread of the server cannot be bound to core " + std::to_string(core));
  }
}

// The first core on which this process may run; in a container it need not be the first of the machine.
int FirstAllowedCore() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  if (sched_getaffinity(0, sizeof(cores), &cores) == 0)
    for (int core = 0; core < CPU_SETSIZE; ++core)
      if (CPU_ISSET(core, &cores)) return core;
  throw std::runtime_error("the cores of this process are not known");
}

struct Carried {
  std::uint64_t sent = 0;
  std::uint64_t used = 0;
  double p50_ms = 0.0;
  double p99_ms = 0.0;
  double max_ms = 0.0;
  double pace = 0.0;
  double share_of_core = 0.0;
  double mib_each = 0.0;

  [[nodiscard]] bool holds() const { return p99_ms <= kMostCarriedLatencyMs && used == sent && pace >= kLeastPace; }
  [[nodiscard]] std::string verdict() const {
    if (pace < kLeastPace) return "the robots were simulated too slowly";
    if (used != sent) return "scans were not used";
    return p99_ms <= kMostCarriedLatencyMs ? "carried" : "too slow";
  }
};

// A server of its own, so that its memory is that of these robots. Nothing if the programs gave up.
std::optional<Carried> Carry(Report& report, int robots, double seconds) {
  const TempDirectory state;  // What a server stores in memory would count as memory of the robots.
  const LiveServer server({"--state", state.path().string()});
  PinToCore(server.pid(), FirstAllowedCore());
  const int pid = std::stoi(server.pid());
  const double before_mib = ResidentMibOf(pid);
  const auto sim =
      server.Start({"sim", "--site", "load", "--robots", std::to_string(robots), "--beams", "360", "--hz", "10",
                    "--world", "building", "--seconds", Number(seconds, 0), "--watch-pid", server.pid()});
  const ChildProcess::Outcome outcome = sim->Wait(LiveServer::kDeadline);
  if (outcome.exit_code != 0) {
    report.Warn(Count(robots) + " robots: " + outcome.output);
    return std::nullopt;
  }
  const nlohmann::json printed = PrintedBy(outcome);
  Carried carried;
  for (const nlohmann::json& robot : printed.at("robots")) {
    carried.sent += robot.at("sent").get<std::uint64_t>();
    carried.used += robot.at("used").get<std::uint64_t>();
  }
  carried.p50_ms = printed.at("pose_latency_p50_ms");
  carried.p99_ms = printed.at("pose_latency_p99_ms");
  carried.max_ms = printed.at("pose_latency_max_ms");
  carried.pace = printed.at("rate");
  carried.share_of_core = printed.at("watched_cpu_share");
  carried.mib_each = (ResidentMibOf(pid) - before_mib) / robots;
  return carried;
}

}  // namespace

void StudyCapacity(StudyContext& context) {
  Report& report = context.report;
  const double seconds = context.seconds > 0.0 ? context.seconds : context.Pick(30.0, 5.0);
  report.Heading("Robots that one core carries");
  report.Text(
      "All threads of the server are bound to one core; the robots are simulated on the others, and are not carried "
      "where that is too slow. Robots at 10 Hz with 360 beams in `building`, for " +
      Number(seconds, 0) +
      " s each, on a server of their own. Memory: what the server takes more than without robots.");
  Table table({"robots", "scans", "used", "p50 (ms)", "p99 (ms)", "max (ms)", "server, share of the core",
               "memory of each (MiB)", "real time", ""});
  std::optional<Carried> most;
  int most_robots = 0;
  const std::vector<int> fleets =
      context.quick ? std::vector<int>{3} : std::vector<int>{16, 32, 48, 64, 80, 96, 128, 160, kWantedRobots};
  for (const int robots : fleets) {
    const auto carried = Carry(report, robots, seconds);
    if (!carried) break;
    table.Add({Count(robots), Count(static_cast<long long>(carried->sent)),
               Count(static_cast<long long>(carried->used)), Number(carried->p50_ms, 1), Number(carried->p99_ms, 1),
               Number(carried->max_ms, 1), Percent(carried->share_of_core), Number(carried->mib_each, 2),
               "x" + Number(carried->pace, 2), carried->verdict()});
    report.Progress(Count(robots) + " robots: p99 " + Number(carried->p99_ms, 1) + " ms, " + carried->verdict());
    if (!carried->holds()) break;
    most = carried;
    most_robots = robots;
  }
  report.Add(table, "capacity");
  if (!most) return report.Fault("not even the smallest fleet was carried");
  report.Text("Carried with p99 of at most " + Number(kMostCarriedLatencyMs, 0) + " ms: " + Count(most_robots) +
              " robots (wanted: " + Count(kWantedRobots) + "), " + Number(most->mib_each, 2) +
              " MiB each (wanted: " + Number(kWantedMibEach, 0) + ").");
  if (context.quick) return;
  if (most_robots < kWantedRobots) report.Warn("fewer robots are carried than wanted");
  if (most->mib_each > kWantedMibEach) report.Warn("a robot takes more memory than wanted");
}

}  // namespace cairn::studies
