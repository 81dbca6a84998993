#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "tests/studies/matchers/match_trial.h"
#include "tests/studies/matchers/matchers.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {
namespace {

constexpr char kCorridor[] =
    "cairn-world: 1\nname: endless-corridor\n"
    "lines: [{points: [[-60, -1.2], [60, -1.2]]}, {points: [[-60, 1.2], [60, 1.2]]}]\n"
    "routes: [{name: r, points: [[-8, 0], [8, 0]]}]\n";
constexpr char kOneWall[] =
    "cairn-world: 1\nname: one-wall\nlines: [{points: [[-60, 1.5], [60, 1.5]]}]\n"
    "routes: [{name: r, points: [[-8, 0], [8, 0]]}]\n";

sim::LaserOptions Wide(double degrees) {
  sim::LaserOptions laser = Sick(0.01);
  laser.field_of_view_rad = Radians(degrees);
  laser.beams = static_cast<int>(degrees) + (degrees < 360 ? 1 : 0);
  return laser;
}

// The walls run along the map's x axis. The study measures the result across it, the heading, and how far the
// answer slides along it.
struct WallTally {
  int cases = 0, flagged = 0, unmatched = 0;
  std::vector<double> across_cm, turn_deg, slid_cm;

  void Add(const MatchCase& match_case, const Pose2& off, const MatchTrial& trial) {
    ++cases;
    unmatched += !trial.result.converged;
    flagged += trial.result.converged && trial.result.degenerate;
    if (!trial.result.converged) return;
    const Pose2 turn{0, 0, match_case.T_map_prev.theta};
    const Eigen::Vector2d in_map = turn * Eigen::Vector2d(trial.error.head<2>()),
                          off_map = turn * Eigen::Vector2d(off.x, off.y);
    across_cm.push_back(100 * std::abs(in_map.y()));
    turn_deg.push_back(Degrees(std::abs(trial.error.z())));
    // Distance from the guess, which is the only information in this direction.
    slid_cm.push_back(100 * std::abs(in_map.x() - off_map.x()));
  }
};

void StudyWalls(StudyContext& context, const std::vector<slam::MatcherKind>& kinds) {
  Table table({"matcher", "world", "converged", "flagged degenerate", "error across p95 (cm)", "turn p95 (deg)",
               "slid along p95 (cm)"});
  for (const slam::MatcherKind kind : kinds) {
    for (const auto& [name, text] : {std::pair{"endless corridor", kCorridor}, std::pair{"one wall", kOneWall}}) {
      const Scene scene(text);
      sim::Random random(context.seed);
      CaseOptions options;
      options.laser = Wide(360);
      options.laser.range_max_m = 12.0;
      WallTally tally;
      for (int i = 0; i < context.Pick(200, 40); ++i) {
        const MatchCase match_case = DrawCase(scene, options, random);
        const Pose2 off{sim::Normal(random, 0.05), sim::Normal(random, 0.05), sim::Normal(random, Radians(2))};
        tally.Add(match_case, off, TryMatch(match_case, off, 0.05, Radians(2), kind, {}));
      }
      const int converged = tally.cases - tally.unmatched;
      table.Add({std::string(slam::MatcherName(kind)), name, Percent(1.0 * converged / tally.cases, 0),
                 converged > 0 ? Percent(1.0 * tally.flagged / converged, 0) : "-",
                 Number(DistributionOf(tally.across_cm).p95, 2), Number(DistributionOf(tally.turn_deg).p95, 2),
                 Number(DistributionOf(tally.slid_cm).p95, 1)});
      if (const double slid = DistributionOf(tally.slid_cm).p95; slid > 5.0)
        context.report.Warn(std::string(slam::MatcherName(kind)) + " leaves the guess along the " + name +
                            " by up to " + Number(slid, 0) + " cm, although the scans show nothing in that direction");
      if (converged > 0 && tally.flagged < converged * 9 / 10)
        context.report.Warn(std::string(slam::MatcherName(kind)) + " does not flag " + name + " as degenerate in " +
                            Percent(1.0 - 1.0 * tally.flagged / converged, 0) + " of its answers");
    }
  }
  context.report.Add(table, "walls");
}

void StudyViews(StudyContext& context, const std::vector<slam::MatcherKind>& kinds) {
  struct Row {
    std::string name;
    double degrees;
    double moving_share;
  };
  const std::vector<Row> rows{{"90 deg", 90, 0},
                              {"120 deg", 120, 0},
                              {"180 deg", 180, 0},
                              {"270 deg", 270, 0},
                              {"360 deg", 360, 0},
                              {"180 deg, half of it moving", 180, 0.5},
                              {"360 deg, half of it moving", 360, 0.5}};
  std::vector<std::string> header{"right / wrong (%)"};
  for (const slam::MatcherKind kind : kinds) header.emplace_back(slam::MatcherName(kind));
  Table table(header);
  Plot plot{.title = "Right answers against field of view, building",
            .x = {"field of view", "deg"},
            .y = {"right", "%", false, 0.0, 101.0}};
  for (const slam::MatcherKind kind : kinds) plot.series.push_back({.label = std::string(slam::MatcherName(kind))});
  const Scene scene("building");
  for (const Row& row : rows) {
    std::vector<std::string> cells{row.name};
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      sim::Random random(context.seed);
      CaseOptions options;
      options.laser = Wide(row.degrees);
      options.moving_share = row.moving_share;
      int good = 0, wrong = 0;
      const int cases = context.Pick(200, 40);
      for (int i = 0; i < cases; ++i) {
        const MatchCase match_case = DrawCase(scene, options, random);
        const Pose2 off{sim::Normal(random, 0.05), sim::Normal(random, 0.05), sim::Normal(random, Radians(2))};
        const MatchTrial trial = TryMatch(match_case, off, 0.05, Radians(2), kinds[k], {});
        good += trial.good();
        wrong += trial.wrong();
      }
      cells.push_back(Number(100.0 * good / cases, 0) + " / " + Number(100.0 * wrong / cases, 0));
      if (row.moving_share > 0) continue;
      plot.series[k].x.push_back(row.degrees);
      plot.series[k].y.push_back(100.0 * good / cases);
    }
    table.Add(cells);
  }
  context.report.Add(table, "views");
  context.report.Add(plot, "views_plot");
}

void StudyEmptyScans(StudyContext& context, const std::vector<slam::MatcherKind>& kinds) {
  const Scene scene("room");
  sim::Random random(context.seed);
  const MatchCase full = DrawCase(scene, {}, random);
  MatchCase no_curr = full, no_prev = full;
  no_curr.curr = no_prev.prev = {};
  std::string silent;
  for (const slam::MatcherKind kind : kinds) {
    bool kept = true;
    for (const MatchCase* empty : {&no_curr, &no_prev}) {
      const MatchTrial trial = TryMatch(*empty, {0.1, 0.05, 0.02}, 0.05, 0.05, kind, {});
      const bool prior_kept = (trial.error - Eigen::Vector3d(0.1, 0.05, 0.02)).norm() < 1e-9;
      if (!trial.result.converged && prior_kept) continue;
      context.report.Fault(std::string(slam::MatcherName(kind)) +
                           " does not report an empty scan as not converged, or does not return the prior");
      kept = false;
    }
    if (kept) silent += (silent.empty() ? "" : ", ") + std::string(slam::MatcherName(kind));
  }
  if (!silent.empty())
    context.report.Text(
        "With an empty scan as either of the two, these matchers report that they have not converged, "
        "and return the prior: " +
        silent + ".");
}

}  // namespace

void StudySpecialCases(StudyContext& context, const std::vector<slam::MatcherKind>& kinds) {
  context.report.Heading("Corridor, one wall, empty scan, narrow views, crowds");
  context.report.Text(
      "If all walls have one direction, the scan does not show the position along them. A matcher "
      "should then flag its answer as degenerate and keep the position of the guess along the walls "
      "(*slid along* is the distance from it). In a crowd, half of the beams end on discs that are at "
      "other places in the other scan. The errors of the guess and the limits of a right answer are "
      "those of the section above.");
  StudyWalls(context, kinds);
  StudyViews(context, kinds);
  StudyEmptyScans(context, kinds);
}

}  // namespace cairn::studies
