#include "server/slam/trail/keyframe.h"

namespace cairn::slam {

Trajectory MapperSnapshot::TrajectoryAlong(std::span<const Pose2> path) const {
  Trajectory trajectory;
  trajectory.reserve(scans.size());
  for (const ScanPlace& place : scans)
    trajectory.push_back({place.stamp, path[place.keyframe] * place.T_keyframe_robot});
  return trajectory;
}

}  // namespace cairn::slam
