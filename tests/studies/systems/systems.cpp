// cairn-study systems: every matcher and every filter over the real logs, time and accuracy in one table.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

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

// All matchers with the first filter, with the refinement and alone; all filters with the first matcher.
std::vector<System> AllSystems() {
  const auto matchers = ChoicesOf("slam.matcher"), filters = ChoicesOf("slam.filter");
  std::vector<System> systems;
  for (const std::string& matcher : matchers) {
    systems.push_back({matcher, matcher, filters.front(), {}});
    systems.push_back({matcher + ", not refined", matcher, filters.front(), {"slam.front_end.refine.enabled=false"}});
  }
  for (std::size_t i = 1; i < filters.size(); ++i)
    systems.push_back({"filter " + filters[i], matchers.front(), filters[i], {}});
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

// The mapper may be wrong, but not silently: a path this far off must have been called lost somewhere.
constexpr double kDivergedMean = 1.0;

bool StudyOneLog(StudyContext& context, const StudyLog& log) {
  Report& report = context.report;
  report.Heading(log.name + ": " + Count(static_cast<long long>(log.scans())) + " scans in " +
                 Number(log.seconds(), 0) + " s");
  Table table({"matcher, filter", "mean (ms)", "p99 (ms)", "max (ms)", "user CPU (s)", "online mean (m)", "(deg)",
               "full mean (m)", "(deg)", "max (m)", "not localized", "scans not simply tracking"});
  Plot plot{.title = "Accuracy against time, " + log.name,
            .x = {"mean processor time per scan", "ms", true},
            .y = {"mean error of relations, online", "m", true}};
  bool plausible = true;
  for (const System& system : AllSystems()) {
    if (!context.Wants(system.name)) continue;
    std::vector<std::string> assignments{"slam.matcher=" + system.matcher, "slam.filter=" + system.filter};
    assignments.insert(assignments.end(), system.more.begin(), system.more.end());
    const auto options = MapperWith(assignments, context.seed);
    if (!options) {
      report.Warn(system.name + ": " + options.error().message);
      plausible = false;
      continue;
    }
    const LogRun run = RunOverLog(log, *options);
    const RelationError online = ErrorOf(run.online, log.relations), full = ErrorOf(run.full, log.relations);
    const Distribution time = run.time_ms();
    table.Add({system.name, Number(time.mean, 2), Number(time.p99, 1), Number(time.max, 1), Number(run.user_cpu_s, 1),
               Number(online.trans_mean_m, 3), Number(online.rot_mean_deg, 2), Number(full.trans_mean_m, 3),
               Number(full.rot_mean_deg, 2), Number(full.trans_max_m, 2),
               Count(static_cast<long long>(run.not_localized)), Reasons(run)});
    plot.series.push_back({.label = system.name, .x = {time.mean}, .y = {online.trans_mean_m}, .mark = Mark::kPoints});
    const bool diverged = !log.relations.empty() && !(online.trans_mean_m < kDivergedMean);
    if (diverged && run.not_localized == 0) {
      report.Warn(system.name + " diverges on " + log.name + " (" + Number(online.trans_mean_m, 2) +
                  " m) and never says that it is not localized");
      plausible = false;
    }
    // Reports come as they are: the longest studies take an hour.
    report.Progress(log.name + ", " + system.name + ": " + Number(time.mean, 2) + " ms a scan, online " +
                    Number(online.trans_mean_m, 3) + " m, full " + Number(full.trans_mean_m, 3) + " m, " +
                    Number(run.user_cpu_s, 1) + " s user");
  }
  report.Add(table, "systems_" + log.name);
  report.Add(plot, "accuracy_" + log.name);
  return plausible;
}

bool RunSystems(StudyContext& context) {
  context.report.Text(
      "One run at a time, one thread, in this process. Times are processor time per scan, so other load on the machine "
      "does them little harm; the user CPU of the whole run stands beside them. Errors are means over the verified "
      "relations of the log (no alignment). Online is what the robot was told at the time, full the best hypothesis' "
      "whole path at the end. Matchers run with the first filter and with it alone in charge of the step (\"not "
      "refined\"); filters run with the first matcher.");
  bool plausible = true;
  for (const StudyLog& log : ChooseLogs(context, {"mit-csail", "intel"}, context.Pick(0, 500)))
    plausible = StudyOneLog(context, log) && plausible;
  return plausible;
}

const Registration kRegistered{"systems", "time per scan and accuracy of every matcher and filter on the real logs",
                               RunSystems};

}  // namespace
}  // namespace cairn::studies
