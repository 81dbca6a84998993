#include "tests/studies/thesis_a/thesis_a.h"

namespace cairn::studies {

std::vector<std::string> LinesOnly() {
  return {"slam.front_end.refine.enabled=false", "slam.revisit.enabled=false", "slam.loop.enabled=false"};
}

std::optional<AccuracyLimits> AccuracyLimitsOf(const StudyLog& log) {
  if (log.name == "mit-csail") return AccuracyLimits{.shipped_m = 0.065, .lines_only_m = 0.6};
  if (log.name == "intel") return AccuracyLimits{.shipped_m = 0.055, .lines_only_m = 1.4};
  return std::nullopt;
}

namespace {

void RunThesisA(StudyContext& context) {
  context.report.Text(
      "Thesis A tests on the logs of Aselsan, Ancona and Intel Jones Farms and measures errors by hand in their maps. "
      "**None of the three is at hand**: the published logs that are (Intel Research Lab Seattle, MIT CSAIL) stand in, "
      "and errors are those of verified relations between poses. Printed figures are the thesis' own, from its logs, "
      "in Matlab on a 2 GHz Core 2 Duo: they stand beside ours for the shape of the curves, not as a race.");
  if (context.Wants("lines")) StudyLineExtraction(context);
  if (context.Wants("pairs")) StudyPoseFromPairs(context);
  if (context.Wants("grid")) StudyGridModels(context);
  const std::vector<StudyLog> logs = ChooseLogs(context, {"intel", "mit-csail"}, context.Pick(0, 2500));
  if (context.Wants("systems")) StudySystems(context, logs);
  if (context.Wants("particles")) StudyParticles(context, logs);
  if (context.Wants("view")) StudyFieldOfView(context, logs);
}

const Registration kRegistered{"thesis-a", "lines, matching and FastSLAM beside the tables and figures of thesis A",
                               RunThesisA};

}  // namespace
}  // namespace cairn::studies
