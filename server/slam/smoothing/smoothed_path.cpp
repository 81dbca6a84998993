#include "server/slam/smoothing/smoothed_path.h"

namespace cairn::slam {

std::optional<std::vector<Pose2>> SmoothedPath(const MapperSnapshot& snapshot, const std::function<bool()>& go_on) {
  std::vector<Pose2> path = snapshot.full_path;
  // If the optimisation finds nothing better, it leaves the path as it is.
  if (snapshot.pose_graph.enabled && OptimisePoses(path, snapshot.relations, snapshot.pose_graph, go_on).cancelled)
    return std::nullopt;
  return path;
}

std::vector<Pose2> SmoothedPath(const MapperSnapshot& snapshot) {
  return *SmoothedPath(snapshot, {});
}

}  // namespace cairn::slam
