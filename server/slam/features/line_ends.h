// Which ends of a line are real. An end is real where the beams beyond it fly past the line (3-10), or meet something
// so close to the end that the line cannot go on behind it (3-11); it is open where something nearer hides what
// follows, where the scan ends, and where the line fades out of range. "Farther" is judged against the line's own
// continuation rather than its last range, so that a box before a receding wall does not close it.
// Source: thesis A 3.4.1, (3-10), (3-11), Figure 3.11.
#pragma once

#include "server/slam/features/line_segment.h"

namespace cairn::slam {

[[nodiscard]] EndClass EndClassOf(const Sweep& sweep, const LineSegment& segment, const LineOptions& options);

}  // namespace cairn::slam
