// The least-squares line through points, computed from running sums, so that adding a point or joining two
// sets costs a few additions. Orthogonal distances are minimised. Any frame; metres. Plain values,
// thread-safe. Source: thesis A (3-4)..(3-9).
#pragma once

#include <Eigen/Core>

namespace cairn::slam {

struct PointSums {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;

  void Add(const Eigen::Vector2d& p) {
    n += 1, x += p.x(), y += p.y(), xx += p.x() * p.x(), xy += p.x() * p.y(), yy += p.y() * p.y();
  }
  friend PointSums operator+(const PointSums& a, const PointSums& b) {
    return {a.n + b.n, a.x + b.x, a.y + b.y, a.xx + b.xx, a.xy + b.xy, a.yy + b.yy};
  }
  friend PointSums operator-(const PointSums& a, const PointSums& b) {
    return {a.n - b.n, a.x - b.x, a.y - b.y, a.xx - b.xx, a.xy - b.xy, a.yy - b.yy};
  }
};

// The line normal . p = offset. `deviation` is the root mean square distance of the points from it (3-12).
struct FittedLine {
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();
  Eigen::Vector2d centroid = Eigen::Vector2d::Zero();
  double offset = 0.0;
  double deviation = 0.0;

  [[nodiscard]] double DistanceOf(const Eigen::Vector2d& p) const { return normal.dot(p) - offset; }
};

// Precondition: at least one point. Coincident points give a line through them along the y axis.
[[nodiscard]] FittedLine FitLine(const PointSums& sums);

}  // namespace cairn::slam
