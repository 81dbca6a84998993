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
      "Thesis B is about fast position tracking by scan matching with lines (no earlier than 2011; the "
      "copy used here has no title page, so its author and title are not known). It tests on scans "
      "that were made with the Stage simulator in a map of its department. **That map is not available "
      "here**, and neither are the logs Jones Farm and Mine. Instead this study uses one scan of the "
      "first available log, and the simulated worlds `corridor` and `building`. The thesis prints "
      "curves and hardly any numbers; what it states in words is repeated beside the figures of Cairn.");
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
