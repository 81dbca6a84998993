// Step 1 of split-and-merge: groups the hits that may belong to one surface by their range (3-3). A hit may
// continue any cluster whose last hit lies up to max_gap_rad before it, not only the cluster of the
// neighbouring hit: behind glass, fences and chair legs the beams hit two surfaces in turn, and single stray
// returns must not break a wall. Clusters may therefore interleave.
// Source: thesis A 3.3, step 1.
#pragma once

#include <utility>
#include <vector>

#include "server/slam/features/line_extraction.h"
#include "server/slam/features/sweep.h"

namespace cairn::slam {

struct HitClusters {
  std::vector<int> order;  // Indices of the hits, cluster after cluster, each in sweep order.
  // Range [begin, end) of each cluster in `order`. Clusters of fewer than 3 hits are left out.
  std::vector<std::pair<int, int>> runs;
};

[[nodiscard]] HitClusters ClusterHits(const Sweep& sweep, const LineOptions& options);

// Largest number of consecutive beams without an echo that does not break a wall (dark paint, glass).
inline constexpr int kToleratedDropouts = 2;

}  // namespace cairn::slam
