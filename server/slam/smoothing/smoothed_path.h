// The path that a smoothing job returns: the best particle's path (full SLAM), which is one sample, optimised
// so that all steps, revisits and loops fit best. If there are no such relations, or `pose_graph.enabled` is
// off, it is the best particle's path without change.
// One pose T_map_robot per keyframe. Stateless, thread-safe, deterministic. May take seconds on long paths.
// Source: thesis A 5.4 (full SLAM); Lu and Milios 1997.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "server/slam/trail/keyframe.h"

namespace cairn::slam {

// `go_on`, if given, is called after each iteration; if it returns false there is no result.
[[nodiscard]] std::optional<std::vector<Pose2>> SmoothedPath(const MapperSnapshot& snapshot,
                                                             const std::function<bool()>& go_on);
[[nodiscard]] std::vector<Pose2> SmoothedPath(const MapperSnapshot& snapshot);

}  // namespace cairn::slam
