// The path a smoothing job answers with: that of the best particle (full SLAM), which is one sample, moved to where all
// steps, revisits and loops fit best. Without such relations, or with `pose_graph.enabled` off, the best particle's
// path as it is. One pose per keyframe, T_map_robot. Stateless, thread-safe, deterministic. May take seconds on long
// paths. Source: thesis A 5.4 (full SLAM); Lu and Milios 1997.
#pragma once

#include <vector>

#include "server/slam/keyframe.h"

namespace cairn::slam {

[[nodiscard]] std::vector<Pose2> SmoothedPath(const MapperSnapshot& snapshot);

}  // namespace cairn::slam
