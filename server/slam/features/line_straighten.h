// The last part of step 4 of split-and-merge. A line of few points between two parallel lines has an
// uncertain slope, which also moves the corners at its ends. Such a line is turned perpendicular to its
// neighbours, the best estimate among right-angled walls, unless its points contradict that. Source: thesis A
// 3.3, step 4, last rule.
#pragma once

#include <vector>

#include "server/slam/features/line_segment.h"

namespace cairn::slam {

void StraightenBetweenParallels(const Sweep& sweep, const LineOptions& options, std::vector<LineSegment>& segments);

}  // namespace cairn::slam
