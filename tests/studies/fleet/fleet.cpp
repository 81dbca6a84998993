// cairn-study fleet measures a live server from outside: the time from scan to pose for fleets of simulated
// robots, the longest delay while whole trajectories are smoothed, and logs that are streamed twenty times
// faster than they were recorded, compared with the same logs offline, joining late where the map is large, and how
// many robots one core carries. Times are wall-clock times, so no other program should run on the machine.
#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "common/mutex.h"
#include "common/sensor/trajectory.h"
#include "common/service/pose_report.h"
#include "common/wire/bus.h"
#include "tests/must.h"
#include "tests/real_log_path.h"
#include "tests/studies/fleet/capacity.h"
#include "tests/studies/fleet/large_site.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/fleet/ros2_latency.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/study.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

using Clock = std::chrono::steady_clock;
using nlohmann::json;

constexpr double kMostLatencyMs = 30.0;  // Scan published to pose received, of 99 in 100 scans.
constexpr double kMostPauseMs = 100.0;
constexpr double kReplayRate = 20.0;
constexpr double kKeptUp = 0.99;  // Share of real time.

double MsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

std::vector<std::string> SimArguments(const LiveServer& server, int robots, int seconds) {
  return {"sim", "--site",  "load",     "--robots",  std::to_string(robots),  "--beams",     "360",       "--hz",
          "10",  "--world", "building", "--seconds", std::to_string(seconds), "--watch-pid", server.pid()};
}

struct Totals {
  std::uint64_t sent = 0, used = 0, dropped = 0;
  std::int64_t unexplained = 0;

  void Add(const json& account) {
    sent += account.at("sent").get<std::uint64_t>();
    used += account.at("used").get<std::uint64_t>();
    dropped += account.at("dropped_total").get<std::uint64_t>();
    unexplained += account.at("unexplained").get<std::int64_t>();
  }
};

Totals TotalsOf(const json& sim) {
  Totals totals;
  for (const json& robot : sim.at("robots")) totals.Add(robot);
  return totals;
}

void ExpectAtMost(Report& report, double most, double value, const std::string& what) {
  report.Expect(value <= most, what + ": " + Number(value, 1) + ", wanted at most " + Number(most, 1));
}

void StudyLatency(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Scan published to pose received");
  Table table({"robots at 10 Hz, 360 beams", "scans", "used", "dropped", "unexplained", "p50 (ms)", "p99 (ms)",
               "wanted", "max (ms)", "real time", "server, share of a core"});
  for (const int robots : {3, 16}) {
    const LiveServer server;
    const json sim = server.Run(SimArguments(server, robots, context.Pick(120, 5)));
    const Totals totals = TotalsOf(sim);
    const double p99 = sim.at("pose_latency_p99_ms");
    table.Add({Count(robots), Count(static_cast<long long>(totals.sent)), Count(static_cast<long long>(totals.used)),
               Count(static_cast<long long>(totals.dropped)), Count(totals.unexplained),
               Number(sim.at("pose_latency_p50_ms"), 1), Number(p99, 1), robots == 3 ? Number(kMostLatencyMs, 0) : "-",
               Number(sim.at("pose_latency_max_ms"), 1), "x" + Number(sim.at("rate"), 2),
               Percent(sim.at("watched_cpu_share"))});
    const std::string who = Count(robots) + " robots";
    if (robots == 3) ExpectAtMost(report, kMostLatencyMs, p99, who + ", p99 in ms");
    ExpectAtMost(report, 0.0, static_cast<double>(totals.sent - totals.used), who + ", scans not used");
    const double rate = sim.at("rate");
    report.Expect(rate >= kKeptUp, who + " were simulated at x" + Number(rate, 2) + " of real time only");
  }
  report.Add(table, "latency");
}

// Something large to smooth: a log if there is one, otherwise a long drive of a simulated robot.
std::string FillLargeSite(StudyContext& context, const LiveServer& server) {
  const auto log = context.logs.empty() ? RealLog("mit-killian.clf") : context.logs.front();
  if (std::filesystem::exists(log) && !context.quick) {
    server.Run({"replay", log.string(), "--site", "large", "--robot", "log", "--fast"});
    return log.stem().string();
  }
  if (!context.quick) context.report.Warn(log.string() + " is absent: a simulated robot in its place");
  server.Run({"sim", "--site", "large", "--prefix", "log", "--robots", "1", "--world", "building", "--seconds",
              std::to_string(context.Pick(1800, 60)), "--fast"});
  return "a simulated robot";
}

// Sends all kinds of request again and again, and smooths both sites in turn, until `robots` is done.
struct Asked {
  int jobs = 0;
  double longest_job_s = 0.0;
  std::vector<double> answer_ms;
};

Asked AskWhile(LiveServer& server, ChildProcess& robots) {
  Asked asked;
  const auto timed = [&asked](auto&& result, Clock::time_point start) {
    asked.answer_ms.push_back(MsSince(start));
    if (!result) throw std::runtime_error(result.error().message);
    return std::move(*result);
  };
  client::QueryClient& queries = server.queries();
  std::optional<Job> job;
  auto job_began = Clock::now();
  // Ten rounds per second, as many clients together would make. With more, the study would measure only the requests.
  while (robots.RunningAfter(std::chrono::milliseconds(100))) {
    const auto sites = timed(queries.Maps(), Clock::now());
    const bool streaming =
        std::any_of(sites.begin(), sites.end(), [](const MapInfo& info) { return info.site == "load"; });
    if (!streaming) continue;  // The fleet has not started yet.
    if (job) job = timed(queries.GetJob(job->id), Clock::now());
    if (job && IsFinal(job->state)) {
      if (job->state != JobState::kSucceeded) throw std::runtime_error("a job failed: " + job->message);
      ++asked.jobs;
      asked.longest_job_s = std::max(asked.longest_job_s, MsSince(job_began) / 1e3);
      job.reset();
    }
    if (!job) {
      job_began = Clock::now();
      job = timed(queries.SubmitJob(asked.jobs % 2 == 0 ? "large" : "load", JobKind::kSmooth), Clock::now());
    }
    (void)timed(queries.Robots(), Clock::now());
    (void)timed(queries.Tiles({.site = "load", .area = {}, .level = 2}), Clock::now());
  }
  return asked;
}

void StudyPauses(StudyContext& context) {
  Report& report = context.report;
  report.Heading("While whole trajectories are smoothed");
  LiveServer server;
  const std::string large = FillLargeSite(context, server);
  const auto robots = server.Start(SimArguments(server, 3, context.Pick(120, 10)));
  const Asked asked = AskWhile(server, *robots);
  const json sim = PrintedBy(robots->Wait(LiveServer::kDeadline));
  const Totals totals = TotalsOf(sim);
  const Distribution answers = DistributionOf(asked.answer_ms);
  report.Text(
      "Three robots stream. At the same time a client asks for status, tiles, maps and jobs ten times "
      "a second, and jobs smooth the site of the robots and a large site (" +
      large + ") in turn: " + Count(asked.jobs) + " jobs in all, of which the longest took " +
      Number(asked.longest_job_s, 1) + " s. Every smoothed map is enabled immediately.");
  Table table({"delay", "times", "p50 (ms)", "p99 (ms)", "max (ms)", "wanted at most"});
  const double slowest = sim.at("pose_latency_max_ms");
  table.Add({"a scan for its pose", Count(static_cast<long long>(totals.used)),
             Number(sim.at("pose_latency_p50_ms"), 1), Number(sim.at("pose_latency_p99_ms"), 1), Number(slowest, 1),
             Number(kMostPauseMs, 0)});
  table.Add({"a question for its answer", Count(static_cast<long long>(asked.answer_ms.size())),
             Number(answers.median, 1), Number(answers.p99, 1), Number(answers.max, 1), Number(kMostPauseMs, 0)});
  report.Add(table, "pauses");
  ExpectAtMost(report, kMostPauseMs, slowest, "longest wait for a pose in ms");
  ExpectAtMost(report, kMostPauseMs, answers.max, "longest wait for an answer in ms");
  ExpectAtMost(report, 0.0, static_cast<double>(totals.sent - totals.used), "scans not used");
  report.Expect(asked.jobs >= 2, "too few jobs ended while the robots were streaming: " + Count(asked.jobs) + "");
}

std::string BytesOf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// The poses of all robots as they are published: those of a path may have moved since, with the map.
class ToldPoses {
 public:
  ToldPoses() {
    wire::WireOptions options;
    options.domain = test::TestDomain();
    bus_ = test::Must(wire::Bus::Create(options, "told-poses"));
    poses_ = test::Must(bus_->Subscribe<PoseReport>([this](PoseReport&& pose) { Take(pose); }, {}));
  }
  ToldPoses(const ToldPoses&) = delete;
  ToldPoses& operator=(const ToldPoses&) = delete;
  ~ToldPoses() { poses_.reset(); }

  [[nodiscard]] Trajectory Of(const std::string& robot) {
    const MutexLock lock(mutex_);
    Trajectory told;
    for (const auto& [stamp, T_map_robot] : told_[robot]) told.push_back({stamp, T_map_robot});
    return told;
  }

 private:
  void Take(const PoseReport& pose) {
    const MutexLock lock(mutex_);
    told_[pose.robot].emplace(pose.stamp, pose.T_map_robot);
  }

  Mutex mutex_;
  std::map<std::string, std::map<Stamp, Pose2>> told_ CAIRN_GUARDED_BY(mutex_);
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<wire::Subscription> poses_;
};

// Whether all poses that were told are those of the other path, but for some that were lost on their way.
bool AreOf(const Trajectory& told, const std::filesystem::path& file, const std::filesystem::path& path) {
  constexpr double kLeastShare = 0.99;
  test::Must(WriteTum(told, file));
  std::set<std::string> lines;
  std::ifstream other(path), mine(file);
  for (std::string line; std::getline(other, line);) lines.insert(line);
  for (std::string line; std::getline(mine, line);)
    if (!lines.contains(line)) return false;
  return static_cast<double>(told.size()) >= kLeastShare * static_cast<double>(lines.size());
}

void StudyReplay(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Logs through the middleware, " + Number(kReplayRate, 0) + " times faster than recorded");
  std::vector<std::filesystem::path> logs = context.logs;
  if (logs.empty()) {
    for (const char* name : {"mit-csail.clf", "intel.clf", "mit-killian.clf"}) {
      if (context.quick && !logs.empty()) break;
      if (std::filesystem::exists(RealLog(name)))
        logs.push_back(RealLog(name));
      else
        report.Warn(RealLog(name).string() + " is absent");
    }
  }
  const LiveServer server;
  ToldPoses told;
  const TempDirectory directory;
  std::vector<std::unique_ptr<ChildProcess>> replays;
  for (const auto& log : logs) {
    const std::string name = log.stem().string();
    replays.push_back(
        server.Start({"replay", log.string(), "--site", name, "--robot", name, "--rate", Number(kReplayRate, 0)}));
  }
  report.Progress("all logs at once, each into a site of its own");
  Table table({"log", "scans", "used", "dropped", "unexplained", "took (s)", "p50 (ms)", "p99 (ms)",
               "online poses as offline", "smoothed path as offline"});
  for (std::size_t i = 0; i < logs.size(); ++i) {
    const std::string name = logs[i].stem().string();
    const json replay = PrintedBy(replays[i]->Wait(LiveServer::kDeadline));
    Totals totals;
    totals.Add(replay);
    server.Run({"job", "smooth", "--site", name, "--wait"});
    server.Run({"path", name, "--smoothed", "-o", (directory / (name + "-smooth.tum")).string()});
    const auto offline = ChildProcess({ProgramPath("cairn-offline"), logs[i].string(), "--json", "--trajectory",
                                       (directory / "offline.tum").string(), "--smoothed-trajectory",
                                       (directory / "offline-smooth.tum").string()})
                             .Wait(LiveServer::kDeadline);
    (void)PrintedBy(offline);
    const bool online_same = AreOf(told.Of(name), directory / (name + ".tum"), directory / "offline.tum");
    const bool smooth_same = BytesOf(directory / (name + "-smooth.tum")) == BytesOf(directory / "offline-smooth.tum");
    table.Add({name, Count(static_cast<long long>(totals.sent)), Count(static_cast<long long>(totals.used)),
               Count(static_cast<long long>(totals.dropped)), Count(totals.unexplained),
               Number(replay.at("seconds"), 0), Number(replay.at("pose_latency_p50_ms"), 1),
               Number(replay.at("pose_latency_p99_ms"), 1), online_same ? "byte for byte" : "DIFFERS",
               smooth_same ? "byte for byte" : "DIFFERS"});
    report.Expect(online_same && smooth_same, name + ": the path from the server differs from the offline path");
    ExpectAtMost(report, 0.0, static_cast<double>(totals.unexplained),
                 name + ": scans that are neither used nor dropped for a stated reason");
  }
  report.Add(table, "replay");
}

void RunFleet(StudyContext& context) {
  if (context.Wants("latency")) StudyLatency(context);
  if (context.Wants("capacity")) StudyCapacity(context);
  if (context.Wants("pauses")) StudyPauses(context);
  if (context.Wants("replay")) StudyReplay(context);
  if (context.Wants("ros2")) StudyRos2Latency(context);
  if (context.Wants("large-site")) StudyLargeSite(context);
}

const Registration kRegistered{"fleet",
                               "a live server: latency, robots that one core carries, pauses during jobs, logs at x20, "
                               "the door for ROS 2, late to a large site (--only latency ...)",
                               RunFleet};

}  // namespace
}  // namespace cairn::studies
