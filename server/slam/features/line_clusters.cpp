#include <algorithm>
#include <cmath>

#include "server/slam/features/split_and_merge.h"

namespace cairn::slam {
namespace {

constexpr int kMinClusterHits = 3;

struct Chain {
  int cluster = 0;
  double range = 0.0;
  int position = 0;    // Position of its last hit, in beams from the first hit of the walk.
  int no_returns = 0;  // Beams without an echo between the first hit of the walk and its last hit.
};

// The hit at which the clustering of a full turn begins, so that no corner is cut. It is the hit after the
// largest jump or, if there is no jump, the nearest hit, which lies in the middle of a wall (the two halves
// of that wall are joined later).
int FirstHit(const Sweep& sweep, const LineOptions& options) {
  if (!sweep.full_turn()) return 0;
  int nearest = 0, after_jump = 0;
  double largest_share = 0.0;
  for (int i = 0; i < sweep.size(); ++i) {
    const double range = sweep.hit(i).range_m, before = sweep.hit(i + sweep.size() - 1).range_m;
    if (range < sweep.hit(nearest).range_m) nearest = i;
    const double allowed = options.jump_m + std::min(range, before) * sweep.GapBefore(i).beams * sweep.step() /
                                                std::tan(options.grazing_rad);
    double share = std::abs(range - before) / std::max(allowed, 1e-9);
    if (sweep.GapBefore(i).no_returns > kToleratedDropouts) share += 1e3;
    if (share > largest_share) largest_share = share, after_jump = i;
  }
  return largest_share > 1.0 ? after_jump : nearest;
}

}  // namespace

HitClusters ClusterHits(const Sweep& sweep, const LineOptions& options) {
  const double spread = sweep.step() / std::tan(options.grazing_rad);
  const int max_gap = sweep.BeamsIn(options.max_gap_rad, 2) + 1;
  std::vector<Chain> chains;  // Clusters that may still grow; there are never more than max_gap.
  std::vector<int> cluster_of(static_cast<std::size_t>(sweep.size()));
  std::vector<int> sizes;
  int position = 0, no_returns = 0;
  const int first = FirstHit(sweep, options);
  for (int walked = 0; walked < sweep.size(); ++walked) {
    const int i = sweep.Wrap(first + walked);
    if (walked > 0) position += sweep.GapBefore(i).beams, no_returns += sweep.GapBefore(i).no_returns;
    std::erase_if(chains, [&](const Chain& chain) {
      return position - chain.position > max_gap || no_returns - chain.no_returns > kToleratedDropouts;
    });
    const double range = sweep.hit(i).range_m;
    Chain* best = nullptr;
    double best_share = 1.0;
    for (Chain& chain : chains) {
      const double allowed = options.jump_m + std::min(range, chain.range) * spread * (position - chain.position);
      const double share = std::abs(range - chain.range) / std::max(allowed, 1e-9);  // (3-3)
      if (share <= best_share) best = &chain, best_share = share;
    }
    if (best == nullptr) {
      chains.push_back({.cluster = static_cast<int>(sizes.size())});
      sizes.push_back(0);
      best = &chains.back();
    }
    best->range = range;
    best->position = position;
    best->no_returns = no_returns;
    cluster_of[static_cast<std::size_t>(i)] = best->cluster;
    ++sizes[static_cast<std::size_t>(best->cluster)];
  }

  HitClusters clusters;
  std::vector<int> next(sizes.size());  // Per cluster: position in `order` of its next hit.
  int begin = 0;
  for (std::size_t c = 0; c < sizes.size(); ++c) {
    next[c] = begin;
    if (sizes[c] >= kMinClusterHits) clusters.runs.emplace_back(begin, begin + sizes[c]);
    begin += sizes[c];
  }
  clusters.order.resize(static_cast<std::size_t>(sweep.size()));
  for (int walked = 0; walked < sweep.size(); ++walked) {
    const int i = sweep.Wrap(first + walked);
    const auto cluster = static_cast<std::size_t>(cluster_of[static_cast<std::size_t>(i)]);
    clusters.order[static_cast<std::size_t>(next[cluster]++)] = i;
  }
  return clusters;
}

}  // namespace cairn::slam
