#include "server/slam/matchers/line_association.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "server/slam/matchers/line_least_squares.h"

namespace cairn::slam {
namespace {

struct Couple {
  int ref = 0, curr = 0;
  double cost = 0.0;
};

}  // namespace

void Visit(OptionVisitor& visitor, LineAssociationOptions& options) {
  visitor.Real("min_normal_dot", options.min_normal_dot, "1", -1.0, 1.0,
               "Smallest dot product of the normals of two lines that are paired (NORM_THRESHOLD).");
  visitor.Real("max_across_m", options.max_across_m, "m", 0.001, 10.0,
               "Largest distance between the midpoints across the wall in the last rounds (MP_THRESHOLD).");
  visitor.Real(
      "max_along_m", options.max_along_m, "m", 0.001, 100.0,
      "Largest distance between the midpoints along the wall, in addition to half the difference of the lengths.");
  visitor.Real("max_slope_rad", options.max_slope_rad, "rad", 0.001, kPi,
               "Largest angle between two lines in the last rounds (ANGLE_THRESHOLD).");
  visitor.Real("first_across_m", options.first_across_m, "m", 0.001, 10.0,
               "Largest distance between the midpoints across the wall in the first round. A larger value tolerates "
               "worse guesses.");
  visitor.Real("first_slope_rad", options.first_slope_rad, "rad", 0.001, kPi,
               "Largest angle between two lines in the first round. A larger value tolerates worse guesses.");
  visitor.Integer("shrinking_rounds", options.shrinking_rounds, "1", 0, 100,
                  "Number of rounds in which the limits shrink from the first values to the last ones. 0 uses the last "
                  "values at once, as the thesis does.");
  visitor.Require(options.max_across_m <= options.first_across_m, "max_across_m", "must not exceed", "first_across_m");
  visitor.Require(options.max_slope_rad <= options.first_slope_rad, "max_slope_rad", "must not exceed",
                  "first_slope_rad");
}

std::vector<LinePair> AssociateLines(std::span<const LineFeature> ref, std::span<const LineFeature> curr,
                                     const Pose2& T_ref_curr, int round, const LineAssociationOptions& options) {
  const double wide = round < options.shrinking_rounds
                          ? 1.0 - static_cast<double>(round) / static_cast<double>(options.shrinking_rounds)
                          : 0.0;
  const double across_gate =
      std::lerp(options.max_across_m, std::max(options.max_across_m, options.first_across_m), wide);
  const double slope_gate =
      std::lerp(options.max_slope_rad, std::max(options.max_slope_rad, options.first_slope_rad), wide);
  std::vector<Couple> couples;
  for (std::size_t c = 0; c < curr.size(); ++c) {
    const PointNormal moved = Transform(T_ref_curr, MidpointAndNormal(curr[c]));
    for (std::size_t p = 0; p < ref.size(); ++p) {
      const PointNormal wall = MidpointAndNormal(ref[p]);
      if (wall.n.dot(moved.n) < options.min_normal_dot) continue;  // (4.18)
      const double turn = std::abs(AngleDiff(AngleDiff(ref[p].slope, curr[c].slope), T_ref_curr.theta));
      const Eigen::Vector2d apart = moved.p - wall.p;
      const double across = std::abs(wall.n.dot(apart));
      const double along = std::abs(ref[p].direction().dot(apart)) - 0.5 * std::abs(ref[p].length - curr[c].length);
      if (turn > slope_gate || across > across_gate || along > options.max_along_m) continue;
      couples.push_back({static_cast<int>(p), static_cast<int>(c),
                         across / across_gate + turn / slope_gate + std::max(0.0, along) / options.max_along_m});
    }
  }
  // The best couples are accepted first, and each line belongs to at most one couple.
  std::sort(couples.begin(), couples.end(), [](const Couple& a, const Couple& b) {
    return std::tie(a.cost, a.ref, a.curr) < std::tie(b.cost, b.ref, b.curr);
  });
  std::vector<bool> ref_used(ref.size(), false), curr_used(curr.size(), false);
  std::vector<LinePair> pairs;
  for (const Couple& couple : couples) {
    const auto p = static_cast<std::size_t>(couple.ref), c = static_cast<std::size_t>(couple.curr);
    if (ref_used[p] || curr_used[c]) continue;
    ref_used[p] = curr_used[c] = true;
    pairs.push_back({couple.ref, couple.curr, 0.0, true});
  }
  std::sort(pairs.begin(), pairs.end(), [](const LinePair& a, const LinePair& b) { return a.ref < b.ref; });
  return pairs;
}

}  // namespace cairn::slam
