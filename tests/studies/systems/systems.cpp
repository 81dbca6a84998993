// cairn-study systems: every matcher and every filter over the real logs, time and accuracy in one table.
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

namespace cairn::studies {
namespace {

struct System {
  std::string name;
  std::string matcher;
  std::string filter;
  std::vector<std::string> more;
};

// All filters with the first matcher; all matchers with the first filter, with the refinement and alone. The
// slowest matcher comes last, so that who watches has the rest.
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

// A run has diverged where what the robot was told is off by half a metre in the mean, or somewhere by more
// than a room: then it drew something twice. It may, but not silently.
constexpr double kDivergedMeanM = 0.5;
constexpr double kDivergedMaxM = 5.0;
// A relation wrong by more than this is one the mapper should not have stood by at both its ends.
constexpr double kWrongM = 1.0;

// From the first pose on that the mapper stood by: before, a robot that knows nothing of its place has none
// in the map.
Trajectory SincePlaced(const LogRun& run) {
  const auto first = std::find(run.localized.begin(), run.localized.end(), std::uint8_t{1}) - run.localized.begin();
  return {run.online.begin() + first, run.online.end()};
}

struct Honesty {
  bool diverged = false;
  std::optional<double> said_at_s;  // Since the first scan, of the first pose that was lost or diverged.
  std::size_t wrong = 0;            // Relations.
  std::size_t stood_by = 0;         // Of them, with both poses localized.

  [[nodiscard]] std::string verdict() const {
    if (!diverged) return "holds";
    return said_at_s ? "diverges, says so" : "DIVERGES SILENTLY";
  }
};

Honesty HonestyOf(const LogRun& run, const StudyLog& log) {
  Honesty honesty;
  const auto stood_by = [&](Stamp stamp) {
    const auto at = std::lower_bound(run.online.begin(), run.online.end(), stamp,
                                     [](const StampedPose& pose, Stamp when) { return pose.stamp < when; });
    return at == run.online.end() || run.localized[static_cast<std::size_t>(at - run.online.begin())] != 0;
  };
  for (std::size_t i = 0; i < run.online.size() && !honesty.said_at_s; ++i)
    if (run.localized[i] == 0) honesty.said_at_s = SecondsFromStamp(run.online[i].stamp - run.online.front().stamp);
  for (const RelationResidual& residual : ResidualsOf(SincePlaced(run), log.relations)) {
    if (residual.trans_m < kWrongM) continue;
    ++honesty.wrong;
    honesty.stood_by += stood_by(residual.from) && stood_by(residual.to) ? 1 : 0;
  }
  const RelationError error = ErrorOf(SincePlaced(run), log.relations);
  // Written so that an error that is not a number counts as diverged.
  honesty.diverged =
      !log.relations.empty() && (!(error.trans_mean_m < kDivergedMeanM) || !(error.trans_max_m < kDivergedMaxM));
  return honesty;
}

// What an earlier drive would have left: the walls along the smoothed path of the defaults.
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
               "relations over 1 m", "of them stood by", "scans not simply tracking"});
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
    const Honesty honesty = HonestyOf(run, log);
    const Distribution time = run.time_ms();
    table.Add({system.name, Number(time.mean, 2), Number(time.p99, 1), Number(time.max, 1), Number(run.user_cpu_s, 1),
               Number(online.trans_mean_m, 3), Number(online.rot_mean_deg, 2), Number(online.trans_max_m, 2),
               Number(full.trans_mean_m, 3), Number(full.rot_mean_deg, 2), Number(full.trans_max_m, 2),
               honesty.verdict(),
               Percent(static_cast<double>(run.not_localized) / static_cast<double>(run.online.size())),
               honesty.said_at_s ? Number(*honesty.said_at_s, 0) : "-", Count(static_cast<long long>(honesty.wrong)),
               Count(static_cast<long long>(honesty.stood_by)), Reasons(run)});
    plot.series.push_back({.label = system.name, .x = {time.mean}, .y = {online.trans_mean_m}, .mark = Mark::kPoints});
    report.Expect(!honesty.diverged || honesty.said_at_s,
                  system.name + " diverges on " + log.name + " (mean " + Number(online.trans_mean_m, 2) +
                      " m, maximum " + Number(online.trans_max_m, 2) + " m) and never says that it is not localized");
    // Reports come as they are: the longest studies take an hour.
    report.Progress(log.name + ", " + system.name + ": " + Number(time.mean, 2) + " ms a scan, online " +
                    Number(online.trans_mean_m, 3) + " m, full " + Number(full.trans_mean_m, 3) + " m, " +
                    honesty.verdict() + ", " + Number(run.user_cpu_s, 1) + " s user");
  }
  report.Add(table, "systems_" + log.name);
  report.Add(plot, "accuracy_" + log.name);
}

void RunSystems(StudyContext& context) {
  context.report.Text(
      "One run at a time, one thread, in this process. Times are processor time per scan, so other load on the machine "
      "does them little harm; the user CPU of the whole run stands beside them. Errors are means over the verified "
      "relations of the log (no alignment). Online is what the robot was told at the time, full the best hypothesis' "
      "whole path at the end. A run diverges where the online mean is over " +
      Number(kDivergedMeanM, 1) + " m or the maximum over " + Number(kDivergedMaxM, 0) +
      " m; it says so where some pose is reported as not localized. Relations over 1 m are those wrong by more than " +
      Number(kWrongM, 0) +
      " m; the mapper stood by those of which it called both poses localized (a loop that closes "
      "puts a jump between a wrong pose and a right one). Matchers run with the first filter and with it alone in "
      "charge of the step (\"not "
      "refined\"); filters run with the first matcher. The filter line_match starts from nothing in the map of lines "
      "that "
      "the defaults' smoothed path draws from the same log; its errors count from where it first stood by a place.");
  for (const StudyLog& log : ChooseLogs(context, {"mit-csail", "intel"}, context.Pick(0, 500)))
    StudyOneLog(context, log);
}

const Registration kRegistered{"systems", "time per scan and accuracy of every matcher and filter on the real logs",
                               RunSystems};

}  // namespace
}  // namespace cairn::studies
