#include "server/tools/offline/run.h"

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iomanip>
#include <numeric>
#include <sstream>

#include "common/bag/recording.h"
#include "common/map/map_lines.h"
#include "common/thread_time.h"
#include "server/known_map.h"
#include "server/slam/grid/grid_image.h"
#include "server/slam/localisation/keyframe_lines.h"
#include "server/slam/scan_pipeline.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "server/tools/log_run/json_line.h"
#include "server/tools/log_run/over_threads.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(rank, 1, values.size()) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double Mean(const std::vector<double>& values) {
  return values.empty() ? 0.0 : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::uint64_t Total(const std::array<std::uint64_t, kDropReasonCount>& dropped) {
  return std::accumulate(dropped.begin(), dropped.end(), std::uint64_t{0});
}

// Of the calling thread: what other programs do on the machine does not count.
double ProcessorMs() {
  return std::chrono::duration<double, std::milli>(ThreadTime()).count();
}

// Measures how long each scan takes, and each step of the estimator.
class ScanTimes {
 public:
  explicit ScanTimes(OfflineReport& report) : report_(report) {}

  // The next record begins: what lies between records belongs to no scan.
  void BeginRecord() {
    Enter(slam::ScanStep::kOther);
    scan_ = {};
    start_ = Clock::now();
  }
  void Enter(slam::ScanStep step) {
    const double now_ms = ProcessorMs();
    scan_[static_cast<std::size_t>(step_)] += now_ms - since_ms_;
    step_ = step;
    since_ms_ = now_ms;
  }
  // A record may complete several scans.
  void EndScan() {
    Enter(slam::ScanStep::kOther);
    const double processor_ms = std::accumulate(scan_.begin(), scan_.end(), 0.0);
    report_.scan_ms.push_back(SecondsSince(start_) * 1e3);
    report_.scan_cpu_ms.push_back(processor_ms);
    for (std::size_t k = 0; k < scan_.size(); ++k) report_.step_ms[k] += scan_[k];
    if (processor_ms > slowest_ms_) report_.slowest_scan_step_ms = scan_;
    slowest_ms_ = std::max(slowest_ms_, processor_ms);
    scan_ = {};
    start_ = Clock::now();
  }

 private:
  OfflineReport& report_;
  std::array<double, slam::kScanStepCount> scan_{};
  double slowest_ms_ = 0.0;
  slam::ScanStep step_ = slam::ScanStep::kOther;
  double since_ms_ = ProcessorMs();
  Clock::time_point start_ = Clock::now();
};

Json StepsJson(const std::array<double, slam::kScanStepCount>& step_ms, double scans) {
  Json steps = Json::object();
  for (std::size_t k = 0; k < step_ms.size(); ++k)
    steps[std::string(slam::kScanStepNames[k])] = scans > 0.0 ? step_ms[k] / scans : 0.0;
  return steps;
}

}  // namespace

void AddUsage(OfflineReport& report) {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  report.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  report.peak_rss_mib = static_cast<double>(usage.ru_maxrss) / 1024.0;
}

Result<void> WriteKnown(const OfflineOptions& options, std::size_t i, const slam::MapperSnapshot& snapshot) {
  if (options.known_trajectories.empty()) return {};
  return WriteTum(snapshot.FullTrajectory(), options.known_trajectories[i]);
}

Result<void> WriteMap(const slam::OccupancyGrid& grid, const std::filesystem::path& path) {
  return SaveMapYaml(slam::ImageOf(grid), path, ".png", MapSaveOptions{});
}

namespace {

Result<void> WriteResults(const OfflineOptions& options, const Trajectory& online, const slam::Mapper& mapper) {
  if (!options.trajectories.empty())
    if (auto written = WriteTum(online, options.trajectories.front()); !written) return written;
  if (!options.map.empty())
    if (auto written = WriteMap(mapper.grid(), options.map); !written) return written;
  if (!options.smooth && options.map_lines.empty() && options.known_trajectories.empty()) return {};
  const slam::MapperSnapshot snapshot = mapper.Snapshot();
  if (auto written = WriteKnown(options, 0, snapshot); !written) return written;
  const auto write_lines = [&](const std::vector<Pose2>& path) {
    return options.map_lines.empty() ? Result<void>{}
                                     : WriteMapLines(LinesOfKeyframes(snapshot.keyframes, path), options.map_lines);
  };
  if (!options.smooth) return write_lines(snapshot.full_path);
  const auto smoothed = slam::SmoothMap(snapshot, options.slam.grid, [] { return true; });
  if (auto written = write_lines(smoothed->path); !written) return written;
  if (!options.smoothed_trajectories.empty()) {
    auto written = WriteTum(snapshot.TrajectoryAlong(smoothed->path), options.smoothed_trajectories.front());
    if (!written) return written;
  }
  return options.smoothed_map.empty() ? Result<void>{} : WriteMap(smoothed->grid, options.smoothed_map);
}

}  // namespace

Result<OfflineRobot> Estimate(const OfflineOptions& options, const std::filesystem::path& log,
                              const Pose2& T_map_robot_start, const LocalisedIn& known) {
  OfflineRobot robot;
  OfflineReport& report = robot.report;
  ScanTimes times(report);
  robot.pipeline = std::make_unique<slam::ScanPipeline>(
      options.slam, T_map_robot_start, OverThreads(options.threads),
      slam::ScanPipeline::Sink{
          [&](const Scan&, const slam::ScanOutcome& outcome) {
            times.EndScan();
            ++report.scans_used;
            report.keyframes += outcome.keyframe ? 1 : 0;
            report.not_localized += outcome.localized ? 0 : 1;
            report.scans_alone += outcome.scans_alone ? 1 : 0;
            if (known.grid == nullptr || outcome.localized)
              robot.online.push_back({outcome.stamp, outcome.T_map_robot});
          },
          [&](const Scan&, DropReason reason) { ++report.dropped[static_cast<std::size_t>(reason)]; }});
  slam::ScanPipeline& pipeline = *robot.pipeline;
  if (known.grid != nullptr) {
    if (auto begun = pipeline.mapper().LocaliseIn(known.grid, known.place_known); !begun)
      return tl::unexpected<Status>(begun.error());
  }
  // Reading the clock so often takes a few per cent of the time.
  if (options.json) pipeline.mapper().WatchSteps([&](slam::ScanStep step) { times.Enter(step); });

  const auto add = [&](LogRecord&& record) {
    times.BeginRecord();
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      report.log_has_odometry = true;
      if (ValidateOdometry(*odometry)) {
        pipeline.Add(*odometry);
      } else {
        ++report.odometry_dropped;
      }
      return true;
    }
    auto scan = std::make_shared<const Scan>(std::move(std::get<Scan>(record)));
    if (const auto valid = ValidateScan(*scan); !valid) {
      ++report.dropped[static_cast<std::size_t>(DropReasonOf(valid.error().fault))];
    } else {
      pipeline.Add(std::move(scan));
    }
    return true;
  };
  auto summary = ReadRecording(log, options.reader, add);
  if (!summary) return tl::unexpected<Status>(summary.error());
  report.log = *std::move(summary);
  times.BeginRecord();
  pipeline.Finish();
  pipeline.mapper().WatchSteps({});
  report.odometry_dropped += pipeline.odometry_refused();
  pipeline.mapper().FinishMap();
  report.landmarks = pipeline.mapper().landmarks().size();
  report.learned = pipeline.mapper().learned();
  return robot;
}

Result<OfflineReport> RunOffline(const OfflineOptions& options) {
  const Clock::time_point start = Clock::now();
  LocalisedIn known;
  if (!options.known_map.empty()) {
    auto grid = ReadKnownGrid(options.known_map, options.slam);
    if (!grid) return tl::unexpected<Status>(grid.error());
    known = {*std::move(grid), options.starts.front().has_value()};
  }
  auto robot = Estimate(options, options.logs.front(), options.starts.front().value_or(Pose2{}), known);
  if (!robot) return tl::unexpected<Status>(robot.error());
  if (auto written = WriteResults(options, robot->online, robot->pipeline->mapper()); !written)
    return tl::unexpected<Status>(written.error());
  robot->report.wall_s = SecondsSince(start);
  AddUsage(robot->report);
  return std::move(robot->report);
}

std::string ReportText(const OfflineReport& report) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(2);
  out << "scans      " << report.scans_used << " used (" << report.keyframes << " keyframes, " << report.not_localized
      << " not localized), " << Total(report.dropped) << " dropped\n";
  for (std::size_t i = 0; i < report.dropped.size(); ++i)
    if (report.dropped[i] > 0)
      out << "           " << report.dropped[i] << ' ' << DropReasonName(static_cast<DropReason>(i)) << '\n';
  if (report.odometry_dropped > 0) out << "odometry   " << report.odometry_dropped << " samples dropped\n";
  if (report.log.complaint_count > 0) {
    out << "log        " << report.log.complaint_count << ' ' << report.log.entry << "s could not be read\n";
    for (const LogComplaint& complaint : report.log.complaints)
      out << "           " << report.log.entry << ' ' << complaint.line << ": " << complaint.reason << '\n';
  }
  out << "time       " << Mean(report.scan_ms) << " ms a scan, median " << Percentile(report.scan_ms, 0.5) << ", p99 "
      << Percentile(report.scan_ms, 0.99) << ", max " << Percentile(report.scan_ms, 1.0) << '\n';
  out << "           " << report.wall_s << " s in all, " << report.cpu_s << " s of processor time\n";
  out << "landmarks  " << report.landmarks << '\n';
  for (const LearnedValue& learned : report.learned)
    if (learned.applied && learned.name != kLearnedNoOdometry && learned.name != kLearnedOdometryStands)
      out << "learned    " << learned.name << ' ' << std::setprecision(4) << learned.value << " +- " << learned.sigma
          << std::setprecision(2) << (learned.unit == "1" ? "" : ' ' + learned.unit) << '\n';
  if (report.scans_alone > 0)
    out << "odometry   not used for " << report.scans_alone << " scans: "
        << (report.log_has_odometry ? "it came later or stands still although the scans move\n" : "there is none\n");
  out << "memory     " << report.peak_rss_mib << " MiB at the most\n";
  return out.str();
}

Json JsonOf(const OfflineReport& report) {
  Json dropped = Json::object();
  for (std::size_t i = 0; i < report.dropped.size(); ++i)
    if (report.dropped[i] > 0) dropped[std::string(DropReasonName(static_cast<DropReason>(i)))] = report.dropped[i];
  Json learned = Json::object();
  for (const LearnedValue& one : report.learned)
    learned[one.name] = {{"unit", one.unit}, {"value", one.value}, {"sigma", one.sigma}, {"applied", one.applied}};
  return {{"time_ms_mean", Mean(report.scan_ms)},
          {"time_ms_p50", Percentile(report.scan_ms, 0.5)},
          {"time_ms_p99", Percentile(report.scan_ms, 0.99)},
          {"time_ms_max", Percentile(report.scan_ms, 1.0)},
          {"cpu_ms_mean", Mean(report.scan_cpu_ms)},
          {"cpu_ms_p50", Percentile(report.scan_cpu_ms, 0.5)},
          {"cpu_ms_p99", Percentile(report.scan_cpu_ms, 0.99)},
          {"cpu_ms_max", Percentile(report.scan_cpu_ms, 1.0)},
          {"step_ms_mean", StepsJson(report.step_ms, static_cast<double>(report.scan_ms.size()))},
          {"step_ms_in_slowest_scan", StepsJson(report.slowest_scan_step_ms, 1.0)},
          {"cpu_s", report.cpu_s},
          {"wall_s", report.wall_s},
          {"scans_used", report.scans_used},
          {"scans_dropped", Total(report.dropped)},
          {"landmarks", report.landmarks},
          {"peak_rss_mib", report.peak_rss_mib},
          {"keyframes", report.keyframes},
          {"not_localized", report.not_localized},
          {"scans_alone", report.scans_alone},
          {"dropped", std::move(dropped)},
          {"learned", std::move(learned)},
          {"log_complaints", report.log.complaint_count}};
}

}  // namespace cairn::server
