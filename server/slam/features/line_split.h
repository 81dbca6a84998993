// Steps 2 and 3 of split-and-merge: each cluster is split until every hit lies near its line.
// Source: thesis A 3.3, Figure 3.7 a-c.
#pragma once

#include <vector>

#include "server/slam/features/line_segment.h"

namespace cairn::slam {

struct SplitResult {
  std::vector<LineSegment> segments;  // In the order of their first hits; each has at least 2 hits.
  std::vector<int> owner;             // Per hit: index of its segment, or -1 if it has none.
};

[[nodiscard]] SplitResult SplitIntoSegments(const Sweep& sweep, const LineOptions& options);

}  // namespace cairn::slam
