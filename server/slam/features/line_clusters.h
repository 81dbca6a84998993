// Step 1 of split-and-merge: hits that may belong to one surface, by their range (3-3). A hit continues a cluster that
// ended up to max_gap_rad before it, not only at its neighbour: behind glass, fences and chair legs two surfaces take
// turns from beam to beam, and single stray returns do not break a wall. Clusters may therefore interleave.
// Source: thesis A 3.3, step 1.
#pragma once

#include <utility>
#include <vector>

#include "server/slam/features/line_extraction.h"
#include "server/slam/features/sweep.h"

namespace cairn::slam {

struct HitClusters {
  std::vector<int> order;  // Hits, cluster after cluster, each in sweep order.
  std::vector<std::pair<int, int>>
      runs;  // [begin, end) of each cluster in `order`; those of fewer than 3 hits left out.
};

[[nodiscard]] HitClusters ClusterHits(const Sweep& sweep, const LineOptions& options);

// Lost beams in a row that do not break a wall (dark paint, glass).
inline constexpr int kToleratedDropouts = 2;

}  // namespace cairn::slam
