// Sums up the particles of a filter: the few places where the robot may be. Stateless, thread-safe.
#pragma once

#include <span>
#include <vector>

#include "common/service/pose_report.h"
#include "server/slam/filters/filter.h"

namespace cairn::server {

// At most kMostHypotheses places, by decreasing weight. Poses that are nearer to a heavier one than 0.2 m and 0.1 rad
// count as one place with it, at the heavier one. The weights of places that are left out are not distributed, so that
// the sum may be below that of `belief`.
[[nodiscard]] std::vector<PoseHypothesis> MostBelieved(std::span<const slam::WeightedPose> belief, Stamp stamp);

}  // namespace cairn::server
