// cairn-study systems: every matcher and every filter over the real logs, time and accuracy in one table. --only seeds:
// the default configuration alone, with several seeds (seeds.h).
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/slam/localisation/keyframe_lines.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/studies/log_run.h"
#include "tests/studies/mapper_choice.h"
#include "tests/studies/study.h"
#include "tests/studies/systems/seeds.h"

namespace cairn::studies {
namespace {

struct System {
  std::string name;
  std::string matcher;
  std::string filter;
  std::vector<std::string> more;
};

// All filters with the first matcher; all matchers with the first filter, with the refinement and alone. The
// slowest matcher comes last, so that the results of all others are there early.
std::vector<System> AllSystems() {
  const auto matchers = ChoicesOf("slam.matcher"), filters = ChoicesOf("slam.filter");
  std::vector<System> systems;
  for (const std::string& filter : filters) systems.push_back({"filter " + filter, matchers.front(), filter, {}});
  for (const std::string& matcher : matchers) {
    if (matcher != matchers.front()) systems.push_back({matcher, matcher, filters.front(), {}});
    systems.push_back({matcher + ", not refined", matcher, filters.front(), {"slam.front_end.refine.enabled=false"}});
  }
  std::stable_partition(systems.begin(), systems.end(), [](const System& s) { return s.matcher != "ndt_de"; });
  return systems;
}

std::string Reasons(const LogRun& run) {
  std::string text;
  for (std::size_t i = 0; i < run.reasons.size(); ++i) {
    if (run.reasons[i] == 0 || static_cast<PoseReason>(i) == PoseReason::kTracking) continue;
    text += (text.empty() ? "" : ", ") + Count(static_cast<long long>(run.reasons[i])) + " " +
            std::string(PoseReasonName(static_cast<PoseReason>(i)));
  }
  return text;
}

// A run has diverged if the online poses are wrong by half a metre on average, or by more than the size of a room
// somewhere, because then parts of the map are drawn twice. This is accepted only if the mapper reports it.
constexpr double kDivergedMeanM = 0.5;
constexpr double kDivergedMaxM = 5.0;
// If a relation is wrong by more than this, the mapper should not have reported both of its poses as localized.
constexpr double kWrongM = 1.0;

// The poses from the first one that was reported as localized. A robot that does not know its place has no pose in the
// map before.
Trajectory SincePlaced(const LogRun& run) {
  const auto first = std::find(run.localized.begin(), run.localized.end(), std::uint8_t{1}) - run.localized.begin();
  return {run.online.begin() + first, run.online.end()};
}

struct Divergence {
  bool diverged = false;
  std::optional<double> said_at_s;  // Since the first scan, of the first pose that was lost or diverged.
  std::size_t wrong = 0;            // Relations that are wrong by more than kWrongM.
  std::size_t trusted = 0;          // Those among them of which both poses were reported as localized.

  [[nodiscard]] std::string verdict() const {
    if (!diverged) return "does not diverge";
    return said_at_s ? "diverges, reported" : "DIVERGES, NOT REPORTED";
  }
};

Divergence DivergenceOf(const LogRun& run, const StudyLog& log) {
  Divergence divergence;
  const auto localized_at = [&](Stamp stamp) {
    const auto at = std::lower_bound(run.online.begin(), run.online.end(), stamp,
                                     [](const StampedPose& pose, Stamp when) { return pose.stamp < when; });
    return at == run.online.end() || run.localized[static_cast<std::size_t>(at - run.online.begin())] != 0;
  };
  for (std::size_t i = 0; i < run.online.size() && !divergence.said_at_s; ++i)
    if (run.localized[i] == 0) divergence.said_at_s = SecondsFromStamp(run.online[i].stamp - run.online.front().stamp);
  for (const RelationResidual& residual : ResidualsOf(SincePlaced(run), log.relations)) {
    if (residual.trans_m < kWrongM) continue;
    ++divergence.wrong;
    divergence.trusted += localized_at(residual.from) && localized_at(residual.to) ? 1 : 0;
  }
  const RelationError error = ErrorOf(SincePlaced(run), log.relations);
  // Written so that an error that is not a number counts as diverged.
  divergence.diverged =
      !log.relations.empty() && (!(error.trans_mean_m < kDivergedMeanM) || !(error.trans_max_m < kDivergedMaxM));
  return divergence;
}

// A map as an earlier drive would have made it: the walls along the smoothed path of the default system.
std::shared_ptr<const std::vector<MapLine>> KnownMapOf(const StudyLog& log, std::uint64_t seed) {
  const slam::MapperSnapshot snapshot = RunOverLog(log, *MapperWith({}, seed)).snapshot;
  return std::make_shared<const std::vector<MapLine>>(
      slam::LinesOfKeyframes(snapshot.keyframes, slam::SmoothedPath(snapshot)));
}

void StudyOneLog(StudyContext& context, const StudyLog& log) {
  Report& report = context.report;
  report.Heading(log.name + ": " + Count(static_cast<long long>(log.scans())) + " scans in " +
                 Number(log.seconds(), 0) + " s");
  Table table({"matcher, filter", "mean (ms)", "p99 (ms)", "max (ms)", "user CPU (s)", "online mean (m)", "(deg)",
               "online max (m)", "full mean (m)", "(deg)", "max (m)", "verdict", "not localized", "first at (s)",
               "relations over 1 m", "both poses localized", "scans not simply tracking"});
  Plot plot{.title = "Accuracy against time, " + log.name,
            .x = {"mean processor time per scan", "ms", true},
            .y = {"mean error of relations, online", "m", true}};
  for (const System& system : AllSystems()) {
    if (!context.Wants(system.name)) continue;
    std::vector<std::string> assignments{"slam.matcher=" + system.matcher, "slam.filter=" + system.filter};
    assignments.insert(assignments.end(), system.more.begin(), system.more.end());
    auto options = MapperWith(assignments, context.seed);
    if (!options) {
      report.Fault(system.name + ": " + options.error().message);
      continue;
    }
    if (options->filter.kind == slam::FilterKind::kLineMatch)
      options->filter.line_match.map = KnownMapOf(log, context.seed);
    const LogRun run = RunOverLog(log, *options);
    const RelationError online = ErrorOf(SincePlaced(run), log.relations), full = ErrorOf(run.full, log.relations);
    const Divergence divergence = DivergenceOf(run, log);
    const Distribution time = run.time_ms();
    table.Add(
        {system.name, Number(time.mean, 2), Number(time.p99, 1), Number(time.max, 1), Number(run.user_cpu_s, 1),
         Number(online.trans_mean_m, 3), Number(online.rot_mean_deg, 2), Number(online.trans_max_m, 2),
         Number(full.trans_mean_m, 3), Number(full.rot_mean_deg, 2), Number(full.trans_max_m, 2), divergence.verdict(),
         Percent(static_cast<double>(run.not_localized) / static_cast<double>(run.online.size())),
         divergence.said_at_s ? Number(*divergence.said_at_s, 0) : "-", Count(static_cast<long long>(divergence.wrong)),
         Count(static_cast<long long>(divergence.trusted)), Reasons(run)});
    plot.series.push_back({.label = system.name, .x = {time.mean}, .y = {online.trans_mean_m}, .mark = Mark::kPoints});
    report.Expect(!divergence.diverged || divergence.said_at_s,
                  system.name + " diverges on " + log.name + " (mean " + Number(online.trans_mean_m, 2) +
                      " m, maximum " + Number(online.trans_max_m, 2) + " m) and never reports a pose as not localized");
    // Each result is printed at once, because the whole study may take an hour.
    report.Progress(log.name + ", " + system.name + ": " + Number(time.mean, 2) + " ms a scan, online " +
                    Number(online.trans_mean_m, 3) + " m, full " + Number(full.trans_mean_m, 3) + " m, " +
                    divergence.verdict() + ", " + Number(run.user_cpu_s, 1) + " s user");
  }
  report.Add(table, "systems_" + log.name);
  report.Add(plot, "accuracy_" + log.name);
}

void RunSystems(StudyContext& context) {
  if (context.only == "seeds") return StudySeeds(context);
  context.report.Text(
      "The runs are made one at a time, with one thread, in this process. Times are processor time per "
      "scan, so that other load on the machine changes them little; the table also shows the user time "
      "of the whole run. Errors are means over the verified relations of the log (without alignment). "
      "*Online* is the pose that the robot was given at the time of the scan; *full* is the whole path "
      "of the best hypothesis at the end. A run has diverged if the online mean is over " +
      Number(kDivergedMeanM, 1) + " m or the maximum over " + Number(kDivergedMaxM, 0) +
      " m. It has reported this if at least one pose was reported as not localized. The next columns "
      "count the relations that are wrong by more than " +
      Number(kWrongM, 0) +
      " m, and those among them of which both poses were reported as localized. (When a loop closes, "
      "there is a jump between a wrong pose and a right one.) Matchers run with the first filter, with "
      "the refinement and without it (\"not refined\"). Filters run with the first matcher. The filter "
      "line_match starts without a known pose in the map of lines that is made ");
  for (const StudyLog& log : ChooseLogs(context, {"mit-csail", "intel"}, context.Pick(0, 500)))
    StudyOneLog(context, log);
  if (context.only.empty()) StudySeeds(context);
}

const Registration kRegistered{"systems", "time per scan and accuracy of every matcher and filter on the real logs",
                               RunSystems};

}  // namespace
}  // namespace cairn::studies
