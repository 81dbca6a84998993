// cairn-study checkpoints: how large the saved state of an estimator is and how long saving and loading it take, over
// an hour of one robot and over a published log, for every filter, and at every hour of a day (--only day, --hours);
// and, for every filter on mit-csail, whether an estimator that is stopped and loaded again at every tenth scan gives
// the same bytes as one that was never stopped.
#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>

#include "common/service/pose_report.h"
#include "server/robots/session_record.h"
#include "server/slam/localisation/keyframe_lines.h"
#include "server/slam/scan_pipeline.h"
#include "tests/studies/logs.h"
#include "tests/studies/mapper_choice.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

constexpr double kLongestPauseMs = 20.0;

slam::ScanPipeline::Sink Ignoring() {
  return {.used = [](const Scan&, const slam::ScanOutcome&) {}, .dropped = [](const Scan&, DropReason) {}};
}

// What a session of the server keeps beside its estimator, and stores in each checkpoint with it.
class SessionAccount {
 public:
  SessionAccount() { static_cast<void>(record_.AddSensors({kSensor})); }

  // An estimator that tells this account what it does with its scans.
  std::unique_ptr<slam::ScanPipeline> MakePipeline(const slam::MapperOptions& options, const Pose2& start) {
    return std::make_unique<slam::ScanPipeline>(
        options, start, slam::SerialFor,
        slam::ScanPipeline::Sink{
            .used = [this](const Scan& scan, const slam::ScanOutcome& outcome) { Used(scan, outcome); },
            .dropped = [this](const Scan& scan,
                              DropReason reason) { record_.ScanDropped(kStream, TakeNumber(scan), reason); }});
  }
  void Add(slam::ScanPipeline& pipeline, const LogRecord& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      if (!ValidateOdometry(*odometry)) return;
      static_cast<void>(record_.OdometryReceived(kSession, ++odometry_));
      pipeline.Add(*odometry);
      record_.OdometryUsed(kSession, odometry_, odometry->stamp);
    } else if (auto scan = std::make_shared<const Scan>(std::get<Scan>(record)); ValidateScan(*scan)) {
      static_cast<void>(record_.ScanReceived(kStream, ++scans_));
      waiting_[scan.get()] = scans_;
      pipeline.Add(std::move(scan));
    }
  }
  // What the session's strand does for a checkpoint (SessionEstimator::Save); whether this was the moment for one.
  bool Save(const slam::ScanPipeline& pipeline) const {
    slam::StateWriter writer;
    server::SessionRecord::WaitingScans waiting;
    for (const auto& [scan, number] : waiting_) waiting[kStream.sensor_id].insert(number);
    if (!record_.Save(writer, waiting)) return false;
    static_cast<void>(pipeline.Save());
    return true;
  }

 private:
  static constexpr const char* kSensor = "laser";
  static constexpr SessionToken kSession = 1;
  static inline const StreamId kStream{HashName("robot"), HashName(kSensor), kSession};

  static SessionRequest Request() {
    SessionRequest request;
    request.robot = "robot";
    request.site = "site";
    request.sensors = {kSensor};
    request.client = request.session = kSession;
    return request;
  }
  std::uint64_t TakeNumber(const Scan& scan) {
    const auto found = waiting_.find(&scan);
    const std::uint64_t number = found->second;
    waiting_.erase(found);
    return number;
  }
  void Used(const Scan& scan, const slam::ScanOutcome& outcome) {
    PoseReport pose;
    pose.stamp = scan.stamp;
    pose.T_map_robot = outcome.T_map_robot;
    pose.scan_sequence = TakeNumber(scan);
    record_.ScanUsed(kStream, pose, outcome.stamp, outcome.keyframe, 1.0);
  }

  server::SessionRecord record_{1, Request(), server::RobotsOptions{}};
  std::map<const Scan*, std::uint64_t> waiting_;  // Inside the estimator, with their numbers.
  std::uint64_t scans_ = 0, odometry_ = 0;
};

void Add(slam::ScanPipeline& pipeline, const LogRecord& record) {
  if (const auto* odometry = std::get_if<Odometry>(&record)) {
    if (ValidateOdometry(*odometry)) pipeline.Add(*odometry);
  } else if (auto scan = std::make_shared<const Scan>(std::get<Scan>(record)); ValidateScan(*scan)) {
    pipeline.Add(std::move(scan));
  }
}

// Saves several times and returns the longest pause. It is measured in processor time, because other programs on the
// machine would lengthen it otherwise.
double MeasureSaving(slam::ScanPipeline& pipeline, const SessionAccount& account, const slam::MapperOptions& options,
                     const StudyLog& log, std::size_t scans, StudyContext& context, Table& table) {
  Stopwatch watch;
  double estimator_ms = 0.0, pause_ms = 0.0;
  for (int i = 0; i < 5; ++i) {
    watch.Restart();
    context.report.Expect(account.Save(pipeline), "the session has no checkpoint at this moment");
    pause_ms = std::max(pause_ms, watch.CpuMs());
    watch.Restart();
    const slam::Checkpoint checkpoint = pipeline.Save();
    estimator_ms = std::max(estimator_ms, watch.CpuMs());
  }
  const slam::Checkpoint checkpoint = pipeline.Save();
  watch.Restart();
  const std::string bytes = checkpoint.Bytes();
  const double bytes_ms = watch.CpuMs();
  slam::ScanPipeline other(options, {}, slam::SerialFor, Ignoring());
  watch.Restart();
  const Result<void> loaded = other.Load(bytes);
  const double load_ms = watch.CpuMs();
  context.report.Expect(loaded.has_value(), loaded ? "" : loaded.error().message);
  std::string again;
  other.Save(again);
  context.report.Expect(again == bytes, "what was loaded is saved as other bytes");
  table.Add({log.name, Count(static_cast<long long>(scans)),
             Count(static_cast<long long>(pipeline.mapper().keyframe_count())),
             Number(static_cast<double>(bytes.size()) / 1e6, 2), Number(estimator_ms, 2), Number(pause_ms, 2),
             Number(bytes_ms, 1), Number(load_ms, 1)});
  context.report.Progress(Count(static_cast<long long>(scans)) + " scans: " +
                          Number(static_cast<double>(bytes.size()) / 1e6, 2) + " MB, pause " + Number(pause_ms, 2) +
                          " ms, bytes " + Number(bytes_ms, 1) + " ms, loading " + Number(load_ms, 1) + " ms");
  return pause_ms;
}

void StudyCost(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Size and time");
  report.Text(
      "The default estimator. The pause is the time that the estimator waits (the longest of five), for its own state "
      "alone and with what the session knows of its scans and its path, as in the server; the bytes are written by "
      "another thread. Processor time.");
  Table table({"log", "scans", "keyframes", "size (MB)", "pause, estimator (ms)", "pause, whole session (ms)",
               "bytes (ms)", "loading (ms)"});
  std::vector<StudyLog> logs;
  sim::FleetOptions options;
  options.seed = context.seed;
  logs.push_back(SimulateLog("building", context.Pick(3600.0, 60.0), options));
  if (auto intel = OpenRealLog(context, "intel", context.Pick(0, 500))) logs.push_back(std::move(*intel));
  double longest_ms = 0.0;
  for (const StudyLog& log : logs) {
    slam::MapperOptions mapper;
    SessionAccount account;
    const auto pipeline = account.MakePipeline(mapper, log.T_map_robot_start);
    const std::size_t all = log.scans(), part = all / 4;
    std::size_t scans = 0;
    for (const LogRecord& record : log.records) {
      account.Add(*pipeline, record);
      if (!std::holds_alternative<Scan>(record)) continue;
      // A server publishes the map once a second.
      if (++scans % 10 == 0) (void)pipeline->mapper().TakeGridChange();
      if (scans % part == 0 || scans == all)
        longest_ms = std::max(longest_ms, MeasureSaving(*pipeline, account, mapper, log, scans, context, table));
    }
  }
  report.Add(table, "cost");
  report.Expect(longest_ms <= kLongestPauseMs, "saving makes the estimator wait for more than 20 ms");
}

// Every filter with its default settings, in a building.
void StudyFilters(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Size and time of every filter");
  Table table({"filter", "scans", "keyframes", "size (MB)", "pause, estimator (ms)", "pause, whole session (ms)",
               "bytes (ms)", "loading (ms)"});
  sim::FleetOptions fleet;
  fleet.seed = context.seed;
  StudyLog log = SimulateLog("building", context.Pick(600.0, 20.0), fleet);
  for (const std::string& filter : ChoicesOf("slam.filter")) {
    auto options = MapperWith({"slam.filter=" + filter}, context.seed);
    if (!options) return report.Fault(options.error().message);
    if (options->filter.kind == slam::FilterKind::kLineMatch) continue;  // It keeps a pose and nothing else.
    SessionAccount account;
    const auto pipeline = account.MakePipeline(*options, log.T_map_robot_start);
    std::size_t scans = 0;
    for (const LogRecord& record : log.records) {
      account.Add(*pipeline, record);
      if (std::holds_alternative<Scan>(record) && ++scans % 10 == 0) (void)pipeline->mapper().TakeGridChange();
    }
    log.name = filter;
    const double pause_ms = MeasureSaving(*pipeline, account, *options, log, scans, context, table);
    report.Expect(pause_ms <= kLongestPauseMs, filter + ": saving makes the estimator wait for more than 20 ms");
  }
  report.Add(table, "filters");
}

// One robot for a day in one building: a row for each hour.
void StudyDay(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Size and time over a day");
  const double hours = context.hours > 0.0 ? context.hours : context.Pick(24.0, 0.05);
  Table table({"log", "scans", "keyframes", "size (MB)", "pause, estimator (ms)", "pause, whole session (ms)",
               "bytes (ms)", "loading (ms)"});
  sim::FleetOptions options;
  options.seed = context.seed;
  const StudyLog log = SimulateLog("building", 3600.0 * hours, options);
  const std::size_t all = log.scans();
  const auto hour = std::max<std::size_t>(1, static_cast<std::size_t>(static_cast<double>(all) / hours));
  slam::MapperOptions mapper;
  SessionAccount account;
  const auto pipeline = account.MakePipeline(mapper, log.T_map_robot_start);
  double longest_ms = 0.0;
  std::size_t scans = 0;
  for (const LogRecord& record : log.records) {
    account.Add(*pipeline, record);
    if (!std::holds_alternative<Scan>(record)) continue;
    if (++scans % 10 == 0) (void)pipeline->mapper().TakeGridChange();
    if (scans % hour != 0 && scans != all) continue;
    longest_ms = std::max(longest_ms, MeasureSaving(*pipeline, account, mapper, log, scans, context, table));
  }
  report.Add(table, "day");
  report.Expect(longest_ms <= kLongestPauseMs, "saving makes the estimator wait for more than 20 ms");
}

struct Course {
  std::vector<Pose2> path;
  std::string state;
};

Course Run(const StudyLog& log, const slam::MapperOptions& options, std::size_t stop_every) {
  Course course;
  const slam::ScanPipeline::Sink sink{
      .used = [&](const Scan&, const slam::ScanOutcome& outcome) { course.path.push_back(outcome.T_map_robot); },
      .dropped = [](const Scan&, DropReason) {}};
  auto pipeline = std::make_unique<slam::ScanPipeline>(options, log.T_map_robot_start, slam::SerialFor, sink);
  std::size_t scans = 0;
  for (const LogRecord& record : log.records) {
    Add(*pipeline, record);
    if (!std::holds_alternative<Scan>(record) || stop_every == 0 || ++scans % stop_every != 0) continue;
    std::string bytes;
    pipeline->Save(bytes);
    pipeline = std::make_unique<slam::ScanPipeline>(options, Pose2{}, slam::SerialFor, sink);
    if (!pipeline->Load(bytes)) return {};
  }
  pipeline->Finish();
  pipeline->Save(course.state);
  return course;
}

void StudySameBytes(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Stopping at every tenth scan");
  const auto log = OpenRealLog(context, "mit-csail", context.Pick(0, 100));
  if (!log) return;
  Table table({"filter", "scans", "poses", "state at the end"});
  const auto study = [&](const std::string& name, const std::vector<std::string>& assignments) {
    auto options = MapperWith(assignments, context.seed);
    if (!options) return report.Fault(options.error().message);
    if (options->filter.kind == slam::FilterKind::kLineMatch) {
      slam::MapperOptions drawing;
      slam::ScanPipeline pipeline(drawing, log->T_map_robot_start, slam::SerialFor, Ignoring());
      for (const LogRecord& record : log->records) Add(pipeline, record);
      const slam::MapperSnapshot snapshot = pipeline.mapper().Snapshot();
      options->filter.line_match.map =
          std::make_shared<const std::vector<MapLine>>(slam::LinesOfKeyframes(snapshot.keyframes, snapshot.full_path));
    }
    const Course whole = Run(*log, *options, 0), stopped = Run(*log, *options, 10);
    const bool poses = whole.path == stopped.path, state = whole.state == stopped.state;
    table.Add({name, Count(static_cast<long long>(log->scans())), poses ? "the same" : "different",
               state ? "the same" : "different"});
    report.Expect(poses && state, name + ": stopping changes the result");
    report.Progress(name);
  };
  for (const std::string& filter : ChoicesOf("slam.filter"))
    if (context.Wants(filter)) study(filter, {"slam.filter=" + filter, "slam.particles=50"});
  if (context.Wants("dpslam")) {
    study("dpslam, flat", {"slam.filter=dpslam", "slam.particles=50", "slam.dpslam.hierarchical=false"});
    study("dpslam, plain high level", {"slam.filter=dpslam", "slam.particles=50", "slam.dpslam.high_level=plain"});
  }
  report.Add(table, "same_bytes");
}

void RunCheckpoints(StudyContext& context) {
  if (context.Wants("cost")) StudyCost(context);
  if (context.Wants("filters")) StudyFilters(context);
  if (context.only == "day") return StudyDay(context);  // Takes long and much memory: only when it is asked for.
  StudySameBytes(context);
}

const Registration kRegistered{"checkpoints", "saving and loading the estimator: size, time, and the same bytes after",
                               RunCheckpoints};

}  // namespace
}  // namespace cairn::studies
