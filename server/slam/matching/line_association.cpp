#include "server/slam/matching/line_association.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "server/slam/matching/line_least_squares.h"

namespace cairn::slam {
namespace {

struct Couple {
  int prev = 0, curr = 0;
  double cost = 0.0;
};

}  // namespace

void Visit(OptionVisitor& visitor, LineAssociationOptions& options) {
  visitor.Real("min_normal_dot", options.min_normal_dot, "1", -1.0, 1.0, "Smaller: lines turned more are considered.");
  visitor.Real("max_across_m", options.max_across_m, "m", 0.001, 10.0, "Between midpoints, across the wall.");
  visitor.Real("max_along_m", options.max_along_m, "m", 0.001, 100.0, "... along it, beyond what lengths explain.");
  visitor.Real("max_slope_rad", options.max_slope_rad, "rad", 0.001, kPi, "Between the slopes.");
  visitor.Real("first_across_m", options.first_across_m, "m", 0.001, 10.0, "Gate at the start; larger: worse guesses.");
  visitor.Real("first_slope_rad", options.first_slope_rad, "rad", 0.001, kPi, "See first_across_m.");
  visitor.Integer("shrinking_rounds", options.shrinking_rounds, "1", 0, 100, "Rounds until the gates are as above.");
}

std::vector<LinePair> AssociateLines(std::span<const LineFeature> prev, std::span<const LineFeature> curr,
                                     const Pose2& T_prev_curr, int round, const LineAssociationOptions& options) {
  const double wide = round < options.shrinking_rounds
                          ? 1.0 - static_cast<double>(round) / static_cast<double>(options.shrinking_rounds)
                          : 0.0;
  const double across_gate =
      std::lerp(options.max_across_m, std::max(options.max_across_m, options.first_across_m), wide);
  const double slope_gate =
      std::lerp(options.max_slope_rad, std::max(options.max_slope_rad, options.first_slope_rad), wide);
  std::vector<Couple> couples;
  for (std::size_t c = 0; c < curr.size(); ++c) {
    const PointNormal moved = Transform(T_prev_curr, MidpointAndNormal(curr[c]));
    for (std::size_t p = 0; p < prev.size(); ++p) {
      const PointNormal wall = MidpointAndNormal(prev[p]);
      if (wall.n.dot(moved.n) < options.min_normal_dot) continue;  // (4.18)
      const double turn = std::abs(AngleDiff(AngleDiff(prev[p].slope, curr[c].slope), T_prev_curr.theta));
      const Eigen::Vector2d apart = moved.p - wall.p;
      const double across = std::abs(wall.n.dot(apart));
      const double along = std::abs(prev[p].direction().dot(apart)) - 0.5 * std::abs(prev[p].length - curr[c].length);
      if (turn > slope_gate || across > across_gate || along > options.max_along_m) continue;
      couples.push_back({static_cast<int>(p), static_cast<int>(c),
                         across / across_gate + turn / slope_gate + std::max(0.0, along) / options.max_along_m});
    }
  }
  // The best couple of all first: one wall, one line.
  std::sort(couples.begin(), couples.end(), [](const Couple& a, const Couple& b) {
    return std::tie(a.cost, a.prev, a.curr) < std::tie(b.cost, b.prev, b.curr);
  });
  std::vector<bool> prev_used(prev.size(), false), curr_used(curr.size(), false);
  std::vector<LinePair> pairs;
  for (const Couple& couple : couples) {
    const auto p = static_cast<std::size_t>(couple.prev), c = static_cast<std::size_t>(couple.curr);
    if (prev_used[p] || curr_used[c]) continue;
    prev_used[p] = curr_used[c] = true;
    pairs.push_back({couple.prev, couple.curr, 0.0, true});
  }
  std::sort(pairs.begin(), pairs.end(), [](const LinePair& a, const LinePair& b) { return a.prev < b.prev; });
  return pairs;
}

}  // namespace cairn::slam
