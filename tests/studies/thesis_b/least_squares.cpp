#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "server/slam/features/feature_extraction.h"
#include "server/slam/localisation/keyframe_lines.h"
#include "server/slam/matchers/line_least_squares.h"
#include "tests/studies/scene.h"
#include "tests/studies/thesis_b/thesis_b.h"

namespace cairn::studies {
namespace {

using slam::LineFeature;

struct Transform {
  const char* figure;
  double x, y, theta;
};
// Table 5.1. (5.2) has sin and -sin the other way round: its matrix turns by -theta.
constexpr Transform kTable[] = {{"5.7", -5, -0.3, -1.5 * kPi},   {"5.8", -5, -0.3, kPi / 6},
                                {"5.9", -5, 7, -1.5 * kPi},      {"5.10", -5, 7, kPi / 6},
                                {"5.11", 0.5, -0.3, -1.5 * kPi}, {"5.12", 0.5, -0.3, kPi / 6},
                                {"5.13", 0.5, 7, -1.5 * kPi},    {"5.14", 0.5, 7, kPi / 6}};

// The first scan of the log that shows enough lines.
std::vector<LineFeature> MostLinesOf(const StudyLog& log, std::string& from) {
  std::vector<LineFeature> best;
  int index = 0;
  for (const LogRecord& record : log.records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr || !ValidateScan(*scan)) continue;
    auto lines = slam::ExtractFeatures(*scan, slam::FeatureOptions{}).lines;
    if (lines.size() > best.size()) {
      best = std::move(lines);
      from = "scan " + Count(index) + " of " + log.name;
    }
    if (++index > 200) break;
  }
  return best;
}

struct Way {
  std::string name;
  slam::LineLeastSquaresOptions options;
};

}  // namespace

void StudyLeastSquares(StudyContext& context, const StudyLog& log) {
  Report& report = context.report;
  report.Heading("Least squares over known pairs (5.4.2, Table 5.1, Figures 5.7-5.14)");
  std::string from;
  const std::vector<LineFeature> lines = MostLinesOf(log, from);
  if (lines.size() < 3) return report.Fault("no scan of " + log.name + " shows three lines");
  report.Text("The " + Count(static_cast<long long>(lines.size())) + " lines of " + from +
              ", are moved by the inverse of each transform of Table 5.1. The least squares start at the "
              "identity and are given the pairs. The thesis states that chi starts high and falls to zero "
              "within a few iterations (it runs 100).");
  std::vector<Way> ways(2);
  ways[0].name = "as shipped";
  ways[1].name = "as printed (all lines have the same weight)";
  ways[1].options.length_power = 0.0;
  for (Way& way : ways) way.options.max_iterations = 100;
  Table table({"figure", "x (m)", "y (m)", "theta (rad)", "weights", "error (m)", "error (deg)", "chi at the start",
               "chi at the end", "steps to 1e-9 of it", "steps"});
  for (const Way& way : ways) {
    Plot plot{.title = "chi over the iterations, " + way.name + " (ends where the step vanishes)",
              .x = {"iteration", ""},
              .y = {"chi + 1e-30", "", true}};
    for (const Transform& wanted : kTable) {
      const Pose2 T{wanted.x, wanted.y, WrapAngle(-wanted.theta)};
      const Pose2 T_inverse = T.Inverse();
      std::vector<slam::WeightedPair> pairs;
      std::vector<LineFeature> moved;
      for (const LineFeature& line : lines) {
        moved.push_back(slam::LineIn(T_inverse, line));
        pairs.push_back({slam::MidpointAndNormal(line), slam::MidpointAndNormal(moved.back()), line.length});
      }
      const slam::LineAlignment alignment = slam::AlignLinePairs(pairs, {}, way.options);
      const Pose2 off = Between(T, alignment.T_ref_curr);
      Series series{.label = std::string("Figure ") + wanted.figure, .mark = Mark::kLine};
      std::size_t quick = alignment.chi.size();
      for (std::size_t i = 0; i < alignment.chi.size(); ++i) {
        series.x.push_back(static_cast<double>(i));
        series.y.push_back(alignment.chi[i] + 1e-30);
        if (alignment.chi[i] < 1e-9 * alignment.chi.front()) quick = std::min(quick, i);
      }
      plot.series.push_back(series);
      const bool found = alignment.converged && off.translation().norm() < 1e-4 && std::abs(off.theta) < 1e-5;
      table.Add({wanted.figure, Number(wanted.x, 1), Number(wanted.y, 1), Number(wanted.theta, 4), way.name,
                 Number(off.translation().norm(), 7), Number(Degrees(std::abs(off.theta)), 7),
                 Number(alignment.chi.front(), 2), Number(alignment.chi.back(), 12),
                 Count(static_cast<long long>(quick)), Count(static_cast<long long>(alignment.chi.size()) - 1)});
      report.Expect(found,
                    std::string("the transform of Figure ") + wanted.figure + " is not recovered (" + way.name + ")");
      if (&way != &ways.front()) continue;
      Plot figure{.title = std::string("Figure ") + wanted.figure + ": the scan, moved away, and brought back",
                  .x = {"x", "m"},
                  .y = {"y", "m"},
                  .equal_scale = true,
                  .width = 800,
                  .height = 700};
      figure.series = {LineSeries(lines, {}, "before", 2), LineSeries(moved, {}, "after the inverse transform", 9),
                       LineSeries(moved, alignment.T_ref_curr, "after least squares", 5)};
      report.Add(figure, std::string("figure_") + wanted.figure);
    }
    report.Add(plot, way.options.length_power == 0.0 ? "chi_thesis" : "chi");
  }
  report.Add(table, "table_5_1");
}

}  // namespace cairn::studies
