#include "client/sim/rectangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace cairn::sim {

Eigen::Vector3d Rectangle::normal() const {
  return side_a.cross(side_b).normalized();
}

double CastAtRectangle(const Rectangle& rectangle, const Eigen::Vector3d& origin_map,
                       const Eigen::Vector3d& direction) {
  constexpr double kRim_m = 1e-9;
  const Eigen::Vector3d normal = rectangle.normal();
  const double approach = normal.dot(direction);
  if (std::abs(approach) < 1e-12) return kNothingHit;
  const double range = normal.dot(rectangle.corner_map - origin_map) / approach;
  if (!(range > 0.0)) return kNothingHit;
  const Eigen::Vector3d p = origin_map + range * direction - rectangle.corner_map;
  const double a = rectangle.side_a.norm(), b = rectangle.side_b.norm();
  const double u = p.dot(rectangle.side_a) / a, v = p.dot(rectangle.side_b) / b;
  const bool inside = u >= -kRim_m && u <= a + kRim_m && v >= -kRim_m && v <= b + kRim_m;
  return inside ? range : kNothingHit;
}

double DistanceTo(const Rectangle& rectangle, const Eigen::Vector3d& p_map) {
  const Eigen::Vector3d p = p_map - rectangle.corner_map;
  const double u = std::clamp(p.dot(rectangle.side_a) / rectangle.side_a.squaredNorm(), 0.0, 1.0);
  const double v = std::clamp(p.dot(rectangle.side_b) / rectangle.side_b.squaredNorm(), 0.0, 1.0);
  return (p - u * rectangle.side_a - v * rectangle.side_b).norm();
}

}  // namespace cairn::sim
