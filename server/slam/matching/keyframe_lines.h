// The walls that keyframes saw, as lines: the known map that LineMatch wants, from a drive. Collinear pieces are
// merged, wherever they were seen from. Frame: `map`, the side that was seen on the left. Stateless, thread-safe,
// deterministic. Source: thesis B 3.4.1 (mergeCollinearLines), over many scans.
#pragma once

#include <span>
#include <vector>

#include "common/map/map_lines.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/keyframe.h"

namespace cairn::slam {

// A line as it is from where T leads: T_a_b takes a line in b to a.
[[nodiscard]] LineFeature LineIn(const Pose2& T_a_b, const LineFeature& line_b);

// One pose T_map_robot of `path` per keyframe. Lines that one keyframe alone saw are left out. The longest first.
[[nodiscard]] std::vector<MapLine> LinesOfKeyframes(std::span<const Keyframe> keyframes, std::span<const Pose2> path);

}  // namespace cairn::slam
