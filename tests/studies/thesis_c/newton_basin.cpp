#include <cmath>
#include <string>
#include <vector>

#include "server/slam/matchers/ndt.h"
#include "server/slam/tracking/front_end.h"
#include "tests/studies/scene.h"
#include "tests/studies/thesis_c/thesis_c.h"

namespace cairn::studies {
namespace {

struct Pair {
  slam::ScanView prev, curr;
  Pose2 truth;
};

std::vector<Pair> DrawPairs(int count, std::uint64_t seed) {
  const Scene scene("office");
  sim::Random random(seed);
  const sim::LaserOptions laser = Sick(0.01);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<Pair> pairs;
  for (int i = 0; i < count; ++i) {
    const Pose2 from = scene.DrawPose(random);
    const Pose2 truth{0.2 * unit(random), 0.1 * unit(random), 0.15 * unit(random)};
    const slam::FrontEndOptions look;
    pairs.push_back({slam::Look(scene.Look(from, laser, random), look),
                     slam::Look(scene.Look(from * truth, laser, random), look), truth});
  }
  return pairs;
}

}  // namespace

void StudyNewtonBasin(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Convergence basin of Newton's algorithm (2.3.3)");
  const std::vector<Pair> pairs = DrawPairs(context.Pick(40, 8), context.seed);
  report.Text(
      "The map shows the share of start poses, in eight directions around the true pose, from which "
      "the answer is right within 5 cm and 1 degree, over " +
      Count(static_cast<long long>(pairs.size())) + " pairs of scans in the shipped office, 180 degrees of view.");
  for (const bool coarse : {false, true}) {
    slam::NdtOptions options;
    if (!coarse) options.coarse.cell_m = 0.0;
    HeatMap map{.title = coarse ? "With a coarse optimisation first" : "Newton's method on 1 m cells only (thesis)",
                .x = {"initial error", "m"},
                .y = {"initial error", "deg"},
                .columns = {0.0, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0},
                .rows = {0.0, 5.0, 10.0, 15.0, 20.0, 30.0},
                .value_label = "share of right answers",
                .print_values = true};
    for (const double turn_deg : map.rows) {
      for (const double off_m : map.columns) {
        int home = 0, tried = 0;
        for (const Pair& pair : pairs) {
          for (int direction = 0; direction < 8; ++direction, ++tried) {
            const double angle = direction * kPi / 4.0;
            const Pose2 error{off_m * std::cos(angle), off_m * std::sin(angle),
                              Radians(direction % 2 == 0 ? turn_deg : -turn_deg)};
            slam::MatchPrior prior{pair.truth * error, Eigen::Vector3d(4.0, 4.0, 1.0).asDiagonal()};
            const slam::MatchResult match = slam::MatchByNdt(pair.prev, pair.curr, prior, options, slam::SerialFor);
            const bool right = match.converged &&
                               (match.T_ref_curr.translation() - pair.truth.translation()).norm() < 0.05 &&
                               std::abs(AngleDiff(match.T_ref_curr.theta, pair.truth.theta)) < Radians(1.0);
            home += right ? 1 : 0;
          }
        }
        map.values.push_back(static_cast<double>(home) / tried);
      }
    }
    report.Add(map, coarse ? "newton_basin_coarse" : "newton_basin");
    report.Expect(map.values.front() > 0.8,
                  "NDT finds the right answer from the true pose in at most 80 % of the cases");
  }
}

}  // namespace cairn::studies
