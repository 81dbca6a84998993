// Scans and distances in a flat simulated world, for tests and studies of single scans. Frame `map`.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "client/sim/laser.h"
#include "client/sim/ray_caster.h"

namespace cairn::sim {

// A level scan. `discs` are obstacles that are not part of the caster's walls.
[[nodiscard]] inline Scan MeasureFlatScan(const RayCaster& walls, std::span<const Disc> discs, const Pose2& T_map_robot,
                                          const Twist& twist, Stamp stamp, const LaserOptions& options,
                                          Random& random) {
  std::vector<Post> posts;
  posts.reserve(discs.size());
  for (const Disc& disc : discs) posts.push_back({disc});
  return MeasureScan(FlatScene(walls), posts, T_map_robot, twist, stamp, 0.0, options, random);
}

// The distance from a point to the nearest wall, in metres; infinite without walls.
[[nodiscard]] inline double DistanceToWalls(std::span<const Segment> walls, const Eigen::Vector2d& p_map) {
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const Segment& wall : walls) {
    const Eigen::Vector2d edge = wall.b_map - wall.a_map;
    const double squared = edge.squaredNorm();
    const double share = squared > 0.0 ? std::clamp((p_map - wall.a_map).dot(edge) / squared, 0.0, 1.0) : 0.0;
    nearest_m = std::min(nearest_m, (wall.a_map + edge * share - p_map).norm());
  }
  return nearest_m;
}

}  // namespace cairn::sim
