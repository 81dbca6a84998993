// Decides between two poses of a scan by how many separate surfaces speak for each. What moves along with the robot,
// such as another robot or a person ahead of it, stands still in its scans. Near and dense, it can outweigh everything
// else in a corridor, whose walls say nothing along it; but it is one small surface, and what stands still in the world
// are many. Points are in `robot`, the poses are T_ref_robot. Stateless, thread-safe.
#pragma once

#include <span>

#include "common/geometry/pose2.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

// The number of surfaces that lie clearly nearer to the reference at the second pose, minus those that do at the first
// one; wide surfaces count twice. Surfaces along the line between the two positions do not vote. The points are in the
// order of their beams.
[[nodiscard]] int SurfaceVotes(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                               const Pose2& T_ref_first, const Pose2& T_ref_second);

}  // namespace cairn::slam
