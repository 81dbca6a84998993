#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "tests/studies/log_run.h"
#include "tests/studies/mapper_choice.h"
#include "tests/studies/scene.h"
#include "tests/studies/thesis_c/thesis_c.h"

namespace cairn::studies {
namespace {

constexpr double kPrintedM = 0.3;  // The error is below this most of the time (Figure 5.25).

// The proposal distribution of the thesis: steps from scans alone move the particles.
struct WithoutOdometry {
  std::string name, matcher, filter;
  std::vector<std::string> more{};
};

// Against the truth: the whole path, and the motion from scan to scan.
struct PathErrors {
  Series accumulated{.mark = Mark::kLine};  // m over m of true way.
  std::vector<double> ahead_m, aside_m, turn_deg;
};

PathErrors ErrorsOf(const Trajectory& path, const Trajectory& truth) {
  PathErrors errors;
  double way = 0.0;
  const StampedPose* last = nullptr;
  const StampedPose* last_truth = nullptr;
  for (const StampedPose& pose : path) {
    const auto there = std::ranges::lower_bound(truth, pose.stamp, {}, &StampedPose::stamp);
    if (there == truth.end() || there->stamp != pose.stamp) continue;
    if (last != nullptr) {
      const Pose2 motion = Between(last_truth->T_map_robot, there->T_map_robot);
      const Eigen::Vector3d off = Between(last->T_map_robot, pose.T_map_robot).vector() - motion.vector();
      errors.ahead_m.push_back(off.x());
      errors.aside_m.push_back(off.y());
      errors.turn_deg.push_back(Degrees(WrapAngle(off.z())));
      way += motion.translation().norm();
    }
    errors.accumulated.x.push_back(way);
    errors.accumulated.y.push_back((pose.T_map_robot.translation() - there->T_map_robot.translation()).norm());
    last = &pose;
    last_truth = &*there;
  }
  return errors;
}

std::string Spread(const std::vector<double>& values, int decimals) {
  const Distribution d = DistributionOf(values);
  return Number(d.mean, decimals) + " +- " + Number(d.deviation, decimals);
}

// Empty if the options do not exist in this build.
std::optional<LogRun> RunAndDraw(StudyContext& context, const StudyLog& log, const WithoutOdometry& system) {
  context.report.Progress("5.3: " + system.name + " on " + log.name);
  std::vector<std::string> assignments{"slam.matcher=" + system.matcher, "slam.filter=" + system.filter,
                                       "slam.front_end.use_odometry=false", "slam.front_end.refine.enabled=false"};
  assignments.insert(assignments.end(), system.more.begin(), system.more.end());
  const auto options = MapperWith(assignments, context.seed);
  if (!options) {
    context.report.Warn(options.error().message);
    return std::nullopt;
  }
  LogRun run = RunOverLog(log, *options);
  Plot plot{.title = log.name + ": " + system.name + ", no odometry", .x = {"x", "m"}, .y = {"y", "m"}};
  plot.series = {PathSeries(run.full, "path")};
  if (!log.truth.empty()) plot.series.push_back(PathSeries(log.truth, "truth"));
  context.report.AddMap(MapOf(run, WhichPath::kFull, options->grid), plot, "dpslam_" + log.name + "_" + system.name);
  return run;
}

StudyLog SimulatedLoops(const StudyContext& context) {
  sim::FleetOptions options;
  options.scan_hz = 5.0;
  options.seed = context.seed;
  options.laser = Sick(0.015);
  options.drive.speed_m_s = 0.9;
  options.drive.turn_rad_s = 1.2;  // As in 5.1: inside Table 4.4.
  return SimulateLog("building", context.Pick(240.0, 16.0), options);
}

}  // namespace

void StudyDpSlamWithoutOdometry(StudyContext& context) {
  Report& report = context.report;
  report.Heading("DP-SLAM fed with scan-matched steps (5.3, Figures 5.24-5.28)");
  report.Text(
      "The estimator gets no odometry. The steps are those of the matcher without refinement, and the "
      "filter is DP-SLAM with its default options (the thesis uses 1000 and 1500 particles). The truth "
      "is that of a simulated drive through the building. The thesis states that the error does not "
      "grow with time and is below 300 mm most of the time, unlike the error of the same steps chained "
      "(Figure 5.7). *End* is the last fifth of the drive. *ndt* is optimised with Newton's method; "
      "*evolution* is the matcher of the thesis, without Newton's method.");
  const std::vector<std::string> one_level{"slam.dpslam.hierarchical=false"};
  const std::vector<std::string> no_climb{"slam.matching.ndt_de.climb=false"};
  const std::vector<WithoutOdometry> systems{{"ndt chained", "ndt", "none"},
                                             {"ndt with dpslam", "ndt", "dpslam"},
                                             {"ndt with dpslam on one level", "ndt", "dpslam", one_level},
                                             {"evolution chained", "ndt_de", "none", no_climb},
                                             {"evolution with dpslam", "ndt_de", "dpslam", no_climb}};
  Table table({"log", "system", "scans", "way (m)", "median (m)", "p95 (m)", "max (m)", "end median (m)",
               "under 300 mm", "step ahead (m)", "step aside (m)", "step turn (deg)", "processor time per scan (ms)"});
  table.Add({"thesis, simulated", "evolution, DP-SLAM", "-", "-", "-", "-", "-", "-", "mostly", "Figure 5.26",
             "Figure 5.27", "Figure 5.28", "-"});
  Plot plot{.title = "Accumulated error of the best particle's path (Figure 5.25)",
            .x = {"way", "m"},
            .y = {"error", "m"},
            .bounds = {{kPrintedM, "300 mm (thesis: below it most of the time)"}}};
  const StudyLog simulated = SimulatedLoops(context);
  for (const WithoutOdometry& system : systems) {
    const auto run = RunAndDraw(context, simulated, system);
    if (!run) continue;
    PathErrors errors = ErrorsOf(run->full, simulated.truth);
    const std::vector<double>& m = errors.accumulated.y;
    const Distribution d = DistributionOf(m);
    const std::vector<double> end(m.begin() + static_cast<long>(m.size() * 4 / 5), m.end());
    const double under = static_cast<double>(std::ranges::count_if(m, [](double e) { return e < kPrintedM; })) /
                         std::max<double>(1.0, static_cast<double>(m.size()));
    table.Add({simulated.name, system.name, Count(static_cast<long long>(m.size())),
               Number(m.empty() ? 0.0 : errors.accumulated.x.back(), 0), Number(d.median, 3), Number(d.p95, 3),
               Number(d.max, 3), Number(DistributionOf(end).median, 3), Percent(under), Spread(errors.ahead_m, 4),
               Spread(errors.aside_m, 4), Spread(errors.turn_deg, 3), Number(run->time_ms().mean, 1)});
    errors.accumulated.label = system.name;
    plot.series.push_back(errors.accumulated);
    report.Expect(system.filter != "dpslam" || under > 0.5,
                  system.name + " has an error of 300 mm or more for at least half of the poses");
  }
  // The truth is not known: the report shows the map, and how many poses were not reported as localized.
  if (const auto log = OpenRealLog(context, "duke-loop5", context.Pick(0, 80))) {
    for (const WithoutOdometry& system : systems) {
      if (system.matcher != "ndt") continue;
      if (const auto run = RunAndDraw(context, *log, system))
        table.Add({log->name, system.name, Count(static_cast<long long>(run->full.size())), "-", "-", "-", "-", "-",
                   Count(static_cast<long long>(run->not_localized)) + " not localized", "-", "-", "-",
                   Number(run->time_ms().mean, 1)});
    }
  }
  report.Add(table, "dpslam_without_odometry");
  report.Add(plot, "figure_5_25");
  report.Text(
      "With one level the error of DP-SLAM stays below one or two cells. With two levels the error is "
      "the same at the same places of every lap, because the map that was made there in the first lap "
      "is bent, and later scans agree with this map.");
}

}  // namespace cairn::studies
