// The walls that keyframes of a drive saw, as lines, in the form of the known map that LineMatch needs.
// Collinear pieces are merged, whichever keyframes saw them. Frame: `map`, with the side that was seen on the
// left. Stateless, thread-safe, deterministic.
// Source: thesis B 3.4.1 (mergeCollinearLines), here over many scans.
#pragma once

#include <span>
#include <vector>

#include "common/map/map_lines.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/trail/keyframe.h"

namespace cairn::slam {

// Transforms a line from frame b to frame a.
[[nodiscard]] LineFeature LineIn(const Pose2& T_a_b, const LineFeature& line_b);

// `path` has one pose T_map_robot per keyframe. Lines that only one keyframe saw are left out. The longest
// line comes first.
[[nodiscard]] std::vector<MapLine> LinesOfKeyframes(std::span<const Keyframe> keyframes, std::span<const Pose2> path);

}  // namespace cairn::slam
