// Step 4 of split-and-merge: segments on one line are joined across the things that stand in front of it,
// lines are lengthened by hits that continue them, segments that are too short or have too few points are
// dropped, and short lines between parallel ones are straightened. Source: thesis A 3.3, step 4.
#pragma once

#include <vector>

#include "server/slam/features/line_split.h"

namespace cairn::slam {

// The remaining segments, in sweep order of their first hits.
[[nodiscard]] std::vector<LineSegment> MergeSegments(const Sweep& sweep, const LineOptions& options, SplitResult split);

}  // namespace cairn::slam
