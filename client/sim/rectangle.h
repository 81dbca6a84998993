// A flat rectangle in space: what three-dimensional worlds are made of. Both sides stop a ray.
// Frame: `map`, metres, z up. Plain value; functions are exact up to rounding and stateless.
// Source: thesis C 4.3.1 (4.38)-(4.39): a rectangle by its points; 4.3.2 (4.40)-(4.41): where a ray meets its plane.
#pragma once

#include <Eigen/Core>

#include "client/sim/ray_caster.h"

namespace cairn::sim {

struct Rectangle {
  Eigen::Vector3d corner_map = Eigen::Vector3d::Zero();
  Eigen::Vector3d side_a = Eigen::Vector3d::UnitX();  // From the corner along two sides, at right angles.
  Eigen::Vector3d side_b = Eigen::Vector3d::UnitY();

  [[nodiscard]] Eigen::Vector3d normal() const;  // Has length 1.
};

// Distance along the ray (`direction` of length 1) to the rectangle; kNothingHit where it misses, runs alongside or
// lies behind. The rim counts as hit: rectangles that share an edge leave no gap.
[[nodiscard]] double CastAtRectangle(const Rectangle& rectangle, const Eigen::Vector3d& origin_map,
                                     const Eigen::Vector3d& direction);

// Distance from a point to the nearest point of the rectangle.
[[nodiscard]] double DistanceTo(const Rectangle& rectangle, const Eigen::Vector3d& p_map);

}  // namespace cairn::sim
