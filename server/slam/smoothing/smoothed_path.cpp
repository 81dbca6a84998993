#include "server/slam/smoothing/smoothed_path.h"

namespace cairn::slam {

std::vector<Pose2> SmoothedPath(const MapperSnapshot& snapshot) {
  std::vector<Pose2> path = snapshot.full_path;
  // Where nothing better is found the path stays as it is.
  if (snapshot.pose_graph.enabled) OptimisePoses(path, snapshot.relations, snapshot.pose_graph);
  return path;
}

}  // namespace cairn::slam
