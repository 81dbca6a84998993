#include <algorithm>
#include <cmath>

#include "server/slam/voting/criteria.h"
#include "server/slam/voting/overlap.h"

namespace cairn::slam {
namespace {

struct Parallel {
  int a = 0, b = 0;
  double offset = 0.0;  // How far b lies to the left of a.
  bool same_way = false;
  OverlapType overlap = OverlapType::kOverlap;
};

// Pairs of parallel lines, ordered by offset. With `both_orders` each pair is also listed in reversed order.
std::vector<Parallel> ParallelsOf(const std::vector<LineFeature>& lines, const ToleranceOptions& options,
                                  bool both_orders) {
  // Two parts of one wall are not a pair, because their distance is noise.
  constexpr double kLeastApart = 0.02;
  std::vector<Parallel> parallels;
  const int count = static_cast<int>(lines.size());
  for (int a = 0; a < count; ++a) {
    for (int b = both_orders ? 0 : a + 1; b < count; ++b) {
      if (a == b) continue;
      const LineFeature &line_a = lines[static_cast<std::size_t>(a)], &line_b = lines[static_cast<std::size_t>(b)];
      if (std::abs(LineAngleDiff(line_a.slope, line_b.slope)) > options.parallel_angle_rad) continue;
      const bool same_way = line_a.direction().dot(line_b.direction()) > 0.0;
      // The mean of the two distances of a midpoint from the other line; they differ if the lines are not
      // exactly parallel.
      const double from_b = line_b.OffsetOf(line_a.midpoint());
      const double offset = 0.5 * (line_a.OffsetOf(line_b.midpoint()) + (same_way ? -from_b : from_b));
      if (std::abs(offset) < kLeastApart) continue;
      parallels.push_back({a, b, offset, same_way, OverlapTypeOf(line_a, line_b)});
    }
  }
  std::sort(parallels.begin(), parallels.end(),
            [](const Parallel& x, const Parallel& y) { return x.offset < y.offset; });
  return parallels;
}

}  // namespace

void VoteByParallels(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  // In a full-turn scan either line of a pair may come first; otherwise the sweep keeps their order.
  const std::vector<Parallel> ref = ParallelsOf(scans.ref.lines, options, false);
  const std::vector<Parallel> curr = ParallelsOf(scans.curr.lines, options, scans.curr.full_turn);
  struct Agreement {
    std::size_t ref, curr;
  };
  std::vector<Agreement> agreements;
  std::vector<int> ref_count(ref.size(), 0), curr_count(curr.size(), 0);
  std::size_t from = 0;
  for (std::size_t i = 0; i < ref.size(); ++i) {
    while (from < curr.size() && curr[from].offset < ref[i].offset - options.parallel_distance_m) ++from;
    for (std::size_t j = from; j < curr.size() && curr[j].offset <= ref[i].offset + options.parallel_distance_m; ++j) {
      if (ref[i].same_way != curr[j].same_way) continue;
      if (!scans.candidates.Has(ref[i].a, curr[j].a) || !scans.candidates.Has(ref[i].b, curr[j].b)) continue;
      agreements.push_back({i, j});
      ++ref_count[i];
      ++curr_count[j];
    }
  }
  for (const Agreement& agreement : agreements) {
    const Parallel &before = ref[agreement.ref], &now = curr[agreement.curr];
    double vote = ref_count[agreement.ref] == 1 && curr_count[agreement.curr] == 1 ? unique : 1.0;
    if (before.overlap == now.overlap) vote += 1.0;
    votes.At(before.a, now.a) += vote;
    votes.At(before.b, now.b) += vote;
  }
}

}  // namespace cairn::slam
