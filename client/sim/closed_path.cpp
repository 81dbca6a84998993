#include "client/sim/closed_path.h"

#include <cmath>

namespace cairn::sim {

double ClosedLength(const std::vector<Eigen::Vector2d>& points) {
  double length = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) length += (points[(i + 1) % points.size()] - points[i]).norm();
  return length;
}

PathPlace PlaceOnPath(const std::vector<Eigen::Vector2d>& points, double way_m) {
  double left = std::fmod(way_m, ClosedLength(points));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t next = (i + 1) % points.size();
    const Eigen::Vector2d leg = points[next] - points[i];
    const double length = leg.norm();
    if (left < length || i + 1 == points.size()) {
      const Eigen::Vector2d direction = length > 0.0 ? Eigen::Vector2d(leg / length) : Eigen::Vector2d(1.0, 0.0);
      return {points[i] + direction * std::min(left, length), std::atan2(direction.y(), direction.x()), next};
    }
    left -= length;
  }
  return {};
}

}  // namespace cairn::sim
