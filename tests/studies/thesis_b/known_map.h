// Maps of lines for LineMatch: the walls of a simulated world, or what the keyframes of a log saw along a path.
// Frame: `map`. Plain values; deterministic.
#pragma once

#include <vector>

#include "client/sim/world.h"
#include "server/slam/keyframe.h"
#include "server/slam/matching/line_match.h"

namespace cairn::studies {

// Every side of a wall that can be seen: sides inside other walls are left out. Walls must be closed outlines or single
// lines; a single line is seen from both sides. Posts and people are not part of it.
[[nodiscard]] std::vector<slam::MapLine> KnownMapOf(const sim::World& world);

// The lines of every keyframe at its pose of `path`, collinear pieces merged (3.4.1); the longest first.
[[nodiscard]] std::vector<slam::MapLine> KnownMapOf(const std::vector<slam::Keyframe>& keyframes,
                                                    const std::vector<Pose2>& path);

// Lines that come this near.
[[nodiscard]] std::vector<slam::MapLine> LinesNear(const std::vector<slam::MapLine>& map, const Eigen::Vector2d& p_map,
                                                   double reach_m);

}  // namespace cairn::studies
