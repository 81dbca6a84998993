// A closed polyline measured by the distance along it. Walkers walk on one, and the starts of robots are spread over
// one.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace cairn::sim {

[[nodiscard]] double ClosedLength(const std::vector<Eigen::Vector2d>& points);

struct PathPlace {
  Eigen::Vector2d p_map = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;  // Towards the next point.
  std::size_t next = 0;      // Index of the next point.
};

// `way_m` from the first point, taken modulo the length. Needs two points and a length above zero.
[[nodiscard]] PathPlace PlaceOnPath(const std::vector<Eigen::Vector2d>& points, double way_m);

}  // namespace cairn::sim
