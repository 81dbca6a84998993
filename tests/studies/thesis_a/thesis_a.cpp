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
      "Thesis A (A. Özgür, A Novel Mobile Robot Navigation Method Based on Combined Feature Based Scan "
      "Matching and FastSLAM Algorithm, METU 2010) tests on logs of Aselsan, Ancona and Intel Jones "
      "Farms, and measures errors by hand in their maps. **None of these three logs is available "
      "here.** Instead this study uses two published logs, Intel Research Lab Seattle and MIT CSAIL, "
      "and measures errors with verified relations between poses. The columns named `thesis` repeat "
      "the figures that the thesis prints for its own logs, measured in Matlab on a 2 GHz Core 2 Duo. "
      "Compare the shapes of the curves with them, not the absolute values.");
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
