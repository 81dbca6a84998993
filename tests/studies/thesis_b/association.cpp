#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/slam/features/feature_extraction.h"
#include "server/slam/matchers/line_lsq.h"
#include "tests/studies/scene.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_b/thesis_b.h"

namespace cairn::studies {
namespace {

using slam::LineFeature;
using slam::ScanFeatures;

struct CorridorPair {
  ScanFeatures prev, curr;
  Pose2 T_ref_curr;
  Pose2 T_map_prev;
};

// `share` of 0.4 m ahead, 0.2 m aside and 14 deg.
CorridorPair DrawPair(const Scene& scene, double share, sim::Random& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (;;) {
    const Pose2 from = scene.DrawPose(random);
    const Pose2 motion{share * 0.4 * unit(random), share * 0.2 * unit(random), share * Radians(14) * unit(random)};
    if (scene.Clearance(from * motion) < 0.3) continue;
    const auto see = [&](const Pose2& pose) {
      sim::LaserOptions laser = Sick(0.01);
      laser.field_of_view_rad =
          Radians(270);  // With doors behind the robot, the position along the corridor is determined better.
      laser.beams = 541;
      return slam::ExtractFeatures(scene.Look(pose, laser, random), slam::FeatureOptions{});
    };
    const ScanFeatures prev = see(from);
    return {prev, see(from * motion), motion, from};
  }
}

// Least squares once, over pairs that are formed once at the identity: the first test of the thesis. The thesis does
// not say how these pairs are formed. Here they have the most similar normals (the first step of 4.3.2), or the nearest
// midpoints among lines with similar normals.
enum class Couples : std::uint8_t { kClosestNormal, kNearestMidpoint };
std::optional<Pose2> LeastSquaresAlone(const CorridorPair& pair, Couples couples, const slam::LineLsqOptions& options) {
  std::vector<slam::WeightedPair> weighed;
  for (const LineFeature& line : pair.curr.lines) {
    const slam::PointNormal curr = slam::MidpointAndNormal(line);
    const LineFeature* nearest = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const LineFeature& wall : pair.prev.lines) {
      const double dot = slam::MidpointAndNormal(wall).n.dot(curr.n);
      if (dot < options.association.min_normal_dot) continue;
      const double apart = couples == Couples::kClosestNormal ? 1.0 - dot : (wall.midpoint() - line.midpoint()).norm();
      if (apart >= least) continue;
      least = apart;
      nearest = &wall;
    }
    if (nearest != nullptr)
      weighed.push_back({slam::MidpointAndNormal(*nearest), curr, std::min(nearest->length, line.length)});
  }
  if (weighed.empty()) return std::nullopt;
  return slam::AlignLinePairs(weighed, {}, options.least_squares).T_ref_curr;
}

// The limits and weights that thesis B prints (5.4.3). MP_THRESHOLD is printed as 0.1^2, the limit of the square of the
// distance.
slam::LineLsqOptions AsPrinted(int rounds) {
  slam::LineLsqOptions options;
  options.association.max_across_m = options.association.max_along_m = options.association.first_across_m = 0.1;
  options.association.first_slope_rad = options.association.max_slope_rad;
  options.association.shrinking_rounds = 0;
  options.least_squares.length_power = 0.0;
  options.max_rounds = rounds;
  options.min_score = 0.0;
  return options;
}

struct Errors {
  std::vector<double> cm, deg;
  int right = 0, cases = 0;
  bool Add(const std::optional<Pose2>& answer, const Pose2& truth) {
    ++cases;
    if (!answer) return false;
    cm.push_back(100 * (answer->translation() - truth.translation()).norm());
    deg.push_back(Degrees(std::abs(AngleDiff(answer->theta, truth.theta))));
    const bool is_right = cm.back() < 10 && deg.back() < 2;
    right += is_right;
    return is_right;
  }
};

// Pairs that one way gets right and another does not.
struct Against {
  int gained = 0, lost = 0;
  void Add(bool alone_right, bool association_right) {
    gained += !alone_right && association_right;
    lost += alone_right && !association_right;
  }
};

void DrawFigures(StudyContext& context, const CorridorPair& pair) {
  slam::LineLsqOptions options;
  const auto alone = LeastSquaresAlone(pair, Couples::kNearestMidpoint, options);
  const slam::LineLsqMatch match = slam::MatchLinesByLeastSquares(pair.prev, pair.curr, {}, options);
  const auto figure = [&](const std::string& title, const Pose2& T, const std::string& label) {
    Plot plot{.title = title, .x = {"x", "m"}, .y = {"y", "m"}, .equal_scale = true, .width = 1100, .height = 620};
    plot.series = {LineSeries(pair.prev.lines, pair.T_map_prev, "seen from p1", 2),
                   LineSeries(pair.curr.lines, pair.T_map_prev, "seen from p2, not moved", 4),
                   LineSeries(pair.curr.lines, pair.T_map_prev * T, label, 0)};
    return plot;
  };
  if (alone)
    context.report.Add(figure("Figure 5.15: least squares alone", *alone, "p2, moved by least squares"), "figure_5_15");
  context.report.Add(
      figure("Figure 5.16: with data association", match.result.T_ref_curr, "p2, moved with association"),
      "figure_5_16");
  Plot plot = figure("Figure 5.17: the associations", match.result.T_ref_curr, "p2, moved with association");
  const auto prev = slam::PolylineLines(pair.prev.lines, options.polylines),
             curr = slam::PolylineLines(pair.curr.lines, options.polylines);
  Series links{.label = "associated", .mark = Mark::kLine, .colour = 6};
  for (const slam::LinePair& link : match.pairs) {
    const Eigen::Vector2d a = pair.T_map_prev * prev[static_cast<std::size_t>(link.ref)].midpoint();
    const Eigen::Vector2d b = pair.T_map_prev * curr[static_cast<std::size_t>(link.curr)].midpoint();
    links.x.insert(links.x.end(), {a.x(), b.x(), NAN});
    links.y.insert(links.y.end(), {a.y(), b.y(), NAN});
  }
  plot.series.pop_back();
  plot.series.push_back(links);
  context.report.Add(plot, "figure_5_17");
}

}  // namespace

void StudyAssociation(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Data association (5.4.3, Figures 5.15-5.18)");
  report.Text(
      "Each case is a pair of poses in the simulated worlds `corridor` and `building`, at most 0.4 m "
      "ahead, 0.2 m aside and 14 deg apart, matched without a guess (the search starts at the "
      "identity). The thesis states that least squares alone find no good transformation, that they do "
      "when the association is repeated 50 times, and that E (5.5) stays high until the 50th round. "
      "\"As printed\" uses the limits of the thesis: 0.8 for normals, 0.1 m for midpoints, 5 deg for "
      "slopes, and the same weight for all lines. An answer is right within 10 cm and 2 deg. *Gained* "
      "counts pairs that are right where least squares alone (with the nearest midpoints) are wrong; "
      "*lost* counts the reverse. *Close* motions are a fifth as large, within the limits of the "
      "thesis.");
  const int cases = context.Pick(400, 60);
  Table table({"world", "way", "right", "gained", "lost", "median (cm)", "p95 (cm)", "median (deg)", "rounds mean",
               "rounds p95"});
  Plot curve{.title = "Figure 5.18: E over the rounds of association (mean of the pairs that end right)",
             .x = {"round", ""},
             .y = {"E", "", true}};
  struct Case {
    std::string name, world;
    double share;
  };
  for (const Case& place :
       {Case{"corridor", "corridor", 1.0}, {"building", "building", 1.0}, {"building, close", "building", 0.2}}) {
    const std::string& world = place.name;
    const Scene scene(place.world);
    enum class Guess : std::uint8_t { kIdentity, kLeastSquares, kOdometry };
    struct Way {
      std::string name;
      slam::LineLsqOptions options;
      Guess guess = Guess::kIdentity;
      Errors errors{};
      Against against{};
      std::vector<double> rounds{}, sums = std::vector<double>(50, 0.0);
      int counted = 0;
    };
    slam::LineLsqOptions one_step = AsPrinted(50);  // Figure 4.2: one step of least squares a round.
    one_step.least_squares.max_iterations = 1;
    std::vector<Way> ways{
        {"association as printed, 1 round", AsPrinted(1)},
        {"association as printed, 50 rounds", AsPrinted(50)},
        {"association as printed, 50 rounds of one step", one_step},
        {"least squares alone, then association as printed, 50 rounds", AsPrinted(50), Guess::kLeastSquares},
        {"association as printed, 50 rounds, odometry as the guess", AsPrinted(50), Guess::kOdometry},
        {"association as shipped", slam::LineLsqOptions{}}};
    sim::Random random(context.seed);
    Errors alone, by_normals;
    Against by_normals_against;
    bool drawn = false;
    for (int i = 0; i < cases; ++i) {
      const CorridorPair pair = DrawPair(scene, place.share, random);
      const auto start = LeastSquaresAlone(pair, Couples::kNearestMidpoint, {});
      const bool alone_right = alone.Add(start, pair.T_ref_curr);
      by_normals_against.Add(alone_right,
                             by_normals.Add(LeastSquaresAlone(pair, Couples::kClosestNormal, {}), pair.T_ref_curr));
      slam::MatchPrior odometry{pair.T_ref_curr, 0.01 * Eigen::Matrix3d::Identity()};
      odometry.T_ref_curr.x += sim::Normal(random, 0.05);
      odometry.T_ref_curr.y += sim::Normal(random, 0.05);
      odometry.T_ref_curr.theta = WrapAngle(odometry.T_ref_curr.theta + sim::Normal(random, Radians(2)));
      bool shipped_right = false;
      for (Way& way : ways) {
        slam::MatchPrior prior;
        if (way.guess == Guess::kOdometry) prior = odometry;
        if (way.guess == Guess::kLeastSquares && start) prior.T_ref_curr = *start;
        const slam::LineLsqMatch match = slam::MatchLinesByLeastSquares(pair.prev, pair.curr, prior, way.options);
        const bool right = way.errors.Add(
            match.result.converged ? std::optional(match.result.T_ref_curr) : std::nullopt, pair.T_ref_curr);
        way.against.Add(alone_right, right);
        if (match.result.converged) way.rounds.push_back(match.result.iterations);
        shipped_right = right;  // Of the last row.
        if (!right || match.errors.empty()) continue;
        ++way.counted;
        for (std::size_t r = 0; r < 50; ++r) way.sums[r] += match.errors[std::min(r, match.errors.size() - 1)];
      }
      if (!drawn && world == "corridor" && shipped_right && !alone_right &&
          pair.T_ref_curr.translation().norm() > 0.25 && pair.curr.lines.size() > 6) {
        DrawFigures(context, pair);
        drawn = true;
      }
    }
    const auto add = [&](const std::string& name, const Errors& e, const Against& against,
                         const std::vector<double>& r) {
      const Distribution d = DistributionOf(r);
      table.Add({world, name, Percent(1.0 * e.right / e.cases), Count(against.gained), Count(against.lost),
                 Number(DistributionOf(e.cm).median, 2), Number(DistributionOf(e.cm).p95, 1),
                 Number(DistributionOf(e.deg).median, 3), Number(d.mean, 1), Number(d.p95, 0)});
    };
    add("least squares alone, pairs by closest normals", by_normals, by_normals_against, {});
    add("least squares alone, pairs by nearest midpoints", alone, {}, {});
    for (const Way& way : ways) {
      add(way.name, way.errors, way.against, way.rounds);
      if (&way == &ways.front() || way.counted == 0) continue;
      Series series{.label = world + ", " + way.name, .mark = Mark::kLine};
      for (std::size_t r = 0; r < 50; ++r)
        series.x.push_back(static_cast<double>(r + 1)), series.y.push_back(way.sums[r] / way.counted);
      curve.series.push_back(series);
    }
    const Way& shipped = ways.back();
    report.Text(world + ": least squares alone fails and association (as shipped) succeeds on " +
                Count(shipped.against.gained) + " of " + Count(cases) + " pairs, the reverse on " +
                Count(shipped.against.lost) + ".");
    report.Expect(shipped.against.gained > shipped.against.lost && shipped.errors.right >= shipped.errors.cases / 2,
                  "association gains no more pairs than it loses, compared with least squares alone: " + world);
    const Way& printed = ways[1];
    report.Expect(place.share >= 1.0 || printed.errors.right >= printed.errors.cases / 2,
                  "association with the limits of the thesis fails on close pairs, which contradicts the thesis");
    if (DistributionOf(shipped.rounds).p95 > 50) report.Warn("more rounds are needed than the 50 of the thesis");
  }
  report.Add(table, "association");
  report.Add(curve, "figure_5_18");
  report.Text(
      "Unlike the curve of the thesis, Cairn needs a few rounds instead of 50, because the least "
      "squares run until they converge in every round. E does not fall to zero, because different "
      "parts of long walls are visible from different places. E may rise in the second round, when "
      "more pairs are used.");
  report.Text(
      "The limits of the thesis presuppose two poses that are close to each other (MP_THRESHOLD = "
      "0.1^2 limits a squared distance; the limits used here, which apply across and along the wall "
      "separately, are at most wider). When the search starts at the identity, no wall passes these "
      "limits after a motion of 5 deg or 0.1 m, in any number of rounds. For close pairs they work as "
      "the thesis states, and least squares over pairs with the most similar normals, the first step "
      "of 4.3.2, fail as in Figure 5.15. With a guess, from least squares or from odometry, the limits "
      "also work for the wide pairs. The limits of Cairn start wide and shrink. Least squares over "
      "pairs with the nearest midpoints, which the thesis does not use, are the stronger method to "
      "compare with.");
}

}  // namespace cairn::studies
