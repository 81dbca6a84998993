#include <Eigen/Cholesky>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "tests/studies/matchers/match_trial.h"
#include "tests/studies/matchers/matchers.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {
namespace {

struct Tally {
  int cases = 0, converged = 0, degenerate = 0, good = 0, wrong = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
  std::vector<double> cpu_ms, metres, degrees;
  double nees = 0.0;

  void Add(const MatchTrial& trial) {
    ++cases;
    cpu_ms.push_back(trial.cpu_ms);
    converged += trial.result.converged;
    degenerate += trial.result.converged && trial.result.degenerate;
    good += trial.good();
    wrong += trial.wrong();
    if (!trial.result.converged || trial.result.degenerate || !trial.near()) return;
    sum += trial.error;
    squares += trial.error.cwiseAbs2();
    metres.push_back(trial.metres());
    degrees.push_back(Degrees(std::abs(trial.error.z())));
    nees += trial.error.dot(trial.result.covariance.ldlt().solve(trial.error));
  }
};

}  // namespace

void StudyExactness(StudyContext& context, const std::vector<slam::MatcherKind>& kinds) {
  Report& report = context.report;
  report.Heading("Time, bias, spread");
  report.Text(
      "The pairs of scans come from the routes of the shipped worlds, are at most 0.3 m and 12 deg "
      "apart and have 181 beams. The guess is wrong by 0.05 m and 2 deg (standard deviations, which "
      "the matcher is given). An answer is *right* if it converged within 0.10 m and 2 deg of the "
      "truth. It is *wrong* if it converged farther off and was not flagged as degenerate; such "
      "answers are dangerous, because nothing marks them. Bias and spread are those of right answers "
      "that are not flagged. NEES is 3 if the stated covariance is right, and larger if it is too "
      "small. Times are processor time with one thread.");
  Table table({"matcher", "noise (cm)", "time mean (ms)", "p99 (ms)", "right", "wrong", "flagged degenerate",
               "bias x, y (mm)", "bias theta (mdeg)", "sigma x, y (mm)", "sigma theta (mdeg)", "p95 (cm)", "NEES"});
  Plot plot{.title = "Error of right answers against range noise",
            .x = {"standard deviation of a range", "cm"},
            .y = {"mean error", "cm", true}};
  for (const slam::MatcherKind kind : kinds) {
    Series series{.label = std::string(slam::MatcherName(kind))};
    for (const double noise : {0.0, 0.01, 0.03}) {
      Tally tally;
      for (const char* world : {"room", "building", "office"}) {
        const Scene scene(world);
        sim::Random random(context.seed);
        CaseOptions options;
        options.laser = Sick(noise);
        for (int i = 0; i < context.Pick(200, 25); ++i) {
          const MatchCase match_case = DrawCase(scene, options, random);
          const Pose2 off{sim::Normal(random, 0.05), sim::Normal(random, 0.05), sim::Normal(random, Radians(2))};
          tally.Add(TryMatch(match_case, off, 0.05, Radians(2), kind, {}));
        }
      }
      const double n = static_cast<double>(tally.metres.size());
      const Eigen::Vector3d bias = tally.sum / n,
                            sigma = (tally.squares / n - bias.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
      const auto pair = [](double x, double y) { return Number(1e3 * x, 1) + ", " + Number(1e3 * y, 1); };
      const Distribution time = DistributionOf(tally.cpu_ms), metres = DistributionOf(tally.metres);
      table.Add({series.label, Number(100 * noise, 0), Number(time.mean, 3), Number(time.p99, 2),
                 Percent(1.0 * tally.good / tally.cases), Percent(1.0 * tally.wrong / tally.cases),
                 Percent(1.0 * tally.degenerate / tally.cases), pair(bias.x(), bias.y()),
                 Number(1e3 * Degrees(bias.z()), 0), pair(sigma.x(), sigma.y()), Number(1e3 * Degrees(sigma.z()), 0),
                 Number(100 * metres.p95, 2), Number(tally.nees / n, 1)});
      series.x.push_back(100 * noise);
      series.y.push_back(100 * metres.mean);
      if (noise > 0.02) continue;
      // A bias beyond four standard errors of the mean and a millimetre is not due to chance.
      for (const int axis : {0, 1})
        if (std::abs(bias[axis]) > 4 * sigma[axis] / std::sqrt(n) + 1e-3)
          report.Warn(series.label + " is biased by " + Number(1e3 * bias[axis], 1) + " mm in " +
                      (axis == 0 ? "x" : "y"));
      report.Expect(tally.good >= tally.cases / 2,
                    series.label + " is right in less than half of the cases with a good guess");
    }
    plot.series.push_back(series);
  }
  report.Add(table, "exactness");
  report.Add(plot, "exactness_plot");
}

}  // namespace cairn::studies
