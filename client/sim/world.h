// A simulated building seen from above: straight walls, round obstacles that stand or walk, and routes for robots.
// Not a physics world: nothing is pushed, and walls have no height. Frame: `map`, metres. Plain value.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace cairn::sim {

struct Segment {
  Eigen::Vector2d a_map;
  Eigen::Vector2d b_map;
};

struct Disc {
  Eigen::Vector2d center_map;
  double radius_m = 0.0;
};

// A disc (a person) that walks along a closed path for ever.
struct Walker {
  double radius_m = 0.0;
  double speed_m_s = 0.0;
  std::vector<Eigen::Vector2d> path_map;  // At least 2 points; from the last back to the first.
};

// Waypoints a robot drives in a circle: at least 2, from the last back to the first.
struct Route {
  std::string name;
  std::vector<Eigen::Vector2d> waypoints_map;
};

struct World {
  std::string name;
  std::vector<Segment> segments;
  std::vector<Disc> discs;
  std::vector<Walker> walkers;
  std::vector<Route> routes;
};

// Where a walker stands after `seconds` (>= 0). It starts at the first point of its path.
[[nodiscard]] Disc WalkerAt(const Walker& walker, double seconds);

}  // namespace cairn::sim
