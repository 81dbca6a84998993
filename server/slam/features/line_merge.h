// Step 4 of split-and-merge: neighbours on one line are joined across whatever stands in front of it, lines are
// lengthened by stray hits, lines too short for what they stand on are dropped, and short lines between parallel ones
// are straightened. Source: thesis A 3.3, step 4.
#pragma once

#include <vector>

#include "server/slam/features/line_split.h"

namespace cairn::slam {

// The lines that remain, in sweep order by their first hit.
[[nodiscard]] std::vector<LineSegment> MergeSegments(const Sweep& sweep, const LineOptions& options, SplitResult split);

}  // namespace cairn::slam
