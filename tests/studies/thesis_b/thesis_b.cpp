#include "tests/studies/thesis_b/thesis_b.h"

#include <limits>
#include <utility>

namespace cairn::studies {

Series LineSeries(std::span<const slam::LineFeature> lines, const Pose2& T, std::string label, int colour) {
  constexpr double kUp = std::numeric_limits<double>::quiet_NaN();
  Series series{.label = std::move(label), .mark = Mark::kLine, .colour = colour};
  for (const slam::LineFeature& line : lines) {
    const Eigen::Vector2d a = T * line.first, b = T * line.last;
    series.x.insert(series.x.end(), {a.x(), b.x(), kUp});
    series.y.insert(series.y.end(), {a.y(), b.y(), kUp});
  }
  return series;
}

namespace {

void RunThesisB(StudyContext& context) {
  context.report.Text(
      "Thesis B tests on scans its authors made with the Stage simulator in the map of their own department, which is "
      "**not at hand** (nor are the Jones Farm and Mine logs): one scan of the first log at hand and the simulated "
      "`corridor` and `building` stand in. It prints curves, hardly any numbers; its words stand beside ours.");
  const std::vector<StudyLog> logs = ChooseLogs(context, {"mit-csail", "intel"}, context.Pick(4000, 400));
  if (context.Wants("least_squares")) StudyLeastSquares(context, logs.front());
  if (context.Wants("association")) StudyAssociation(context);
  if (context.Wants("tracking")) StudyTracking(context, logs);
  if (context.Wants("line_match")) StudyLineMatch(context);
}

const Registration kRegistered{
    "thesis-b", "the line matcher by least squares beside Table 5.1 and the figures of thesis B", RunThesisB};

}  // namespace
}  // namespace cairn::studies
