// Classifies the ends of a line. An end is real if the beams beyond it pass the line (3-10), or if they hit
// something so close to the end that the line cannot continue behind it (3-11). It is open if something
// nearer hides what follows, if the scan ends there, or if the line goes out of range. Whether a hit is
// farther away is judged against the continuation of the line and not against its last range, so that a box
// in front of a receding wall does not close the end of the wall.
// Source: thesis A 3.4.1, (3-10), (3-11), Figure 3.11.
#pragma once

#include "server/slam/features/line_segment.h"

namespace cairn::slam {

[[nodiscard]] EndClass EndClassOf(const Sweep& sweep, const LineSegment& segment, const LineOptions& options);

}  // namespace cairn::slam
