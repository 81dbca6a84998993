// What smoothing answers for one robot: its whole path, and the grid drawn anew along it, beside how well its scans
// agree with that and with what the robot was told at the time. Where no place was seen again there is nothing to fit:
// the best particle's path is one sample of many, the online path their mean, and the one the scans agree with better
// is the answer. With `pose_graph.enabled` off it is the best particle's in any case (thesis A 5.4). Stateless,
// thread-safe, deterministic. May take seconds on long paths.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "server/slam/keyframe.h"
#include "server/slam/smoothing/disagreement.h"

namespace cairn::slam {

struct SmoothedMap {
  std::vector<Pose2> path;  // T_map_robot, one per keyframe.
  OccupancyGrid grid;       // Drawn along `path`.
  Disagreement before;      // Of the online path with the grid drawn along it,
  Disagreement after;       // and of `path` with `grid`.
};

inline constexpr int kSmoothingStepsPerKeyframe = 4;  // Two paths, each drawn and compared.

// `next` is called before each step, and ends the work where it answers false; then there is no answer.
[[nodiscard]] std::optional<SmoothedMap> SmoothMap(const MapperSnapshot& snapshot, const GridOptions& options,
                                                   const std::function<bool()>& next);

}  // namespace cairn::slam
