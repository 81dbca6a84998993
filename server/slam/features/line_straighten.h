// The last part of step 4: a line of few points between two parallel ones has a poor slope of its own, and the corners
// at its ends move with it. Turned perpendicular to its neighbours (the best estimate among right-angled walls) unless
// its points contradict that. Source: thesis A 3.3, step 4, last rule.
#pragma once

#include <vector>

#include "server/slam/features/line_segment.h"

namespace cairn::slam {

void StraightenBetweenParallels(const Sweep& sweep, const LineOptions& options, std::vector<LineSegment>& segments);

}  // namespace cairn::slam
