#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_c/ndt_study.h"
#include "tests/studies/thesis_c/thesis_c.h"

namespace cairn::studies {
namespace {

// Figure 5.7: distance between the chained and the true position.
Series AccumulatedError(const ScanSequence& drive, const SequenceErrors& errors, std::string label) {
  Series series{.label = std::move(label), .mark = Mark::kLine};
  const std::vector<Pose2> chain = ChainOf(errors);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Pose2 truth = Between(drive.T_map_robot.front(), drive.T_map_robot[i]);
    series.x.push_back(static_cast<double>(i));
    series.y.push_back((chain[i].translation() - truth.translation()).norm());
  }
  return series;
}

// A robust standard deviation (1.48 times the median distance from the median), and the errors beyond three of it.
struct Shape {
  double middle = 0.0, sigma = 0.0, tail_share = 0.0, tail_mean = 0.0;
};
Shape ShapeOf(const std::vector<double>& values) {
  Shape shape;
  shape.middle = DistributionOf(values).median;
  std::vector<double> distances;
  for (const double v : values) distances.push_back(std::abs(v - shape.middle));
  shape.sigma = 1.4826 * DistributionOf(distances).median;
  double tail = 0.0, sum = 0.0;
  for (const double v : values) {
    if (std::abs(v - shape.middle) <= 3.0 * shape.sigma) continue;
    ++tail;
    sum += v;
  }
  shape.tail_share = tail / static_cast<double>(values.size());
  shape.tail_mean = tail > 0.0 ? sum / tail : 0.0;
  return shape;
}

Series Histogram(const std::vector<double>& values, double reach, std::string label) {
  constexpr int kBars = 61;
  Series series{.label = std::move(label), .y = std::vector<double>(kBars, 0.0), .mark = Mark::kLine};
  for (int bar = 0; bar < kBars; ++bar) series.x.push_back(reach * (2.0 * bar / (kBars - 1) - 1.0));
  for (const double v : values) {
    const long bar = std::lround((v / reach + 1.0) * 0.5 * (kBars - 1));
    series.y[static_cast<std::size_t>(std::clamp(bar, 0L, static_cast<long>(kBars - 1)))] += 1.0;
  }
  return series;
}

void ReportDistribution(Report& report, const SequenceErrors& errors) {
  report.Heading("How the errors are distributed (5.2, Figure 5.19)");
  std::vector<double> ahead, aside, turn;
  for (const StepError& step : errors.steps) {
    ahead.push_back(step.error.x());
    aside.push_back(step.error.y());
    turn.push_back(Degrees(step.error.z()));
  }
  Table table({"error", "thesis", "median", "robust sigma", "share beyond 3 sigma", "mean of these"});
  const auto add = [&](const std::string& name, const std::string& printed, const std::vector<double>& values) {
    const Shape shape = ShapeOf(values);
    table.Add({name, printed, Number(shape.middle, 4), Number(shape.sigma, 4), Percent(shape.tail_share),
               Number(shape.tail_mean, 3)});
  };
  add("ahead (m; thesis: dy)", "N(0, 0.02) and a little N(-0.20, 0.10)", ahead);
  add("aside (m; thesis: dx)", "one normal distribution", aside);
  add("turn (deg)", "one normal distribution", turn);
  report.Add(table, "figure_5_19_errors");
  Plot plot{.title = "Distribution of the errors at 15 mm noise (Figure 5.19)",
            .x = {"error", "m"},
            .y = {"poses", ""},
            .series = {Histogram(ahead, 0.06, "ahead"), Histogram(aside, 0.06, "aside")}};
  report.Add(plot, "figure_5_19_histogram");
}

}  // namespace

void StudyRangeNoise(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Noise of the ranges (5.1.2, Figures 5.5-5.9)");
  report.Text(
      "The population is 100, with 50 generations. `climb` means that Newton's method follows the "
      "evolution, which the thesis does not do.");
  Table table({"sigma (mm)", "thesis", "mean (m)", "max (m)", "mean (deg)", "max (deg)", "off by > 0.1 m or 2 deg",
               "climb: mean (m)", "climb: mean (deg)", "climb: off"});
  Plot metres{.title = "Error of the displacement by range noise (Figures 5.5, 5.6)",
              .x = {"pose", ""},
              .y = {"error", "m", false, 0.0, {}}};
  Plot accumulated{.title = "Accumulated error of the position at 15 mm noise (Figure 5.7)",
                   .x = {"pose", ""},
                   .y = {"error", "m", false, 0.0, {}}};
  std::vector<double> means;
  SequenceErrors at_15_mm;
  for (const double noise_mm : {15.0, 25.0, 40.0, 80.0}) {
    report.Progress("noise " + Number(noise_mm, 0) + " mm");
    const ScanSequence drive = SimulatedDrive(context, noise_mm / 1000.0);
    slam::NdtDeOptions options = ThesisOptions(context.seed);
    const SequenceErrors errors = MatchSequence(drive, options);
    options.climb = true;
    const SequenceErrors climbed = MatchSequence(drive, options);
    const Distribution m = DistributionOf(errors.metres()), deg = DistributionOf(errors.degrees());
    table.Add({Number(noise_mm, 0), noise_mm < 80.0 ? "robust" : "larger errors, still robust", Number(m.mean, 4),
               Number(m.max, 3), Number(deg.mean, 3), Number(deg.max, 2), Count(errors.lost()),
               Number(DistributionOf(climbed.metres()).mean, 4), Number(DistributionOf(climbed.degrees()).mean, 3),
               Count(climbed.lost())});
    Series series{.label = Number(noise_mm, 0) + " mm", .mark = Mark::kLine};
    for (std::size_t i = 0; i < errors.steps.size(); ++i) series.x.push_back(static_cast<double>(i + 1));
    series.y = errors.metres();
    metres.series.push_back(series);
    means.push_back(m.mean);
    if (noise_mm == 15.0) {
      accumulated.series.push_back(AccumulatedError(drive, errors, "evolution alone (thesis)"));
      accumulated.series.push_back(AccumulatedError(drive, climbed, "with the climb"));
      at_15_mm = errors;
    }
  }
  report.Add(table, "figures_5_5_5_6_noise");
  report.Add(metres, "figures_5_5_5_6_noise_m");
  report.Text(
      "The thesis shows in Figure 5.7 that the accumulated error grows with the distance travelled. At "
      "the end it is " +
      Number(accumulated.series[0].y.back(), 2) + " m here with evolution alone, and " +
      Number(accumulated.series[1].y.back(), 2) + " m with the climb.");
  report.Add(accumulated, "figure_5_7_accumulated");
  ReportDistribution(report, at_15_mm);
  report.Expect(means.back() > means.front() && std::isfinite(means.back()),
                "more noise does not lead to larger errors, which contradicts the thesis");
}

}  // namespace cairn::studies
