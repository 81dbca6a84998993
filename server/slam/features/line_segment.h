// A line while it is being found: the hits that belong to it, by index into a Sweep, and the line fitted through them.
// Frames and units as in Sweep. Used inside line extraction only.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/slam/features/line_extraction.h"
#include "server/slam/features/line_fit.h"
#include "server/slam/features/sweep.h"

namespace cairn::slam {

struct LineSegment {
  int begin = 0;  // First hit; in [0, size()).
  int end = 0;    // One past the last hit; beyond size() across the seam of a full turn.
  PointSums sums;
  FittedLine line;
  bool alive = true;

  [[nodiscard]] int count() const { return static_cast<int>(sums.n); }
};

// How far a hit may lie from a line it belongs to.
[[nodiscard]] inline double SplitDistance(double range_m, const LineOptions& options) {
  return options.split_m + options.split_per_m * range_m;
}

// How far a hit at the end of a line may lie from the line through the others. Tighter than SplitDistance: a hit of the
// next wall just round a corner has all the leverage on the slope of this one.
[[nodiscard]] inline double EndDistance(const FittedLine& others, double range_m, const LineOptions& options) {
  return std::min(SplitDistance(range_m, options), std::max(3.0 * others.deviation, 2.0 * options.range_sigma_m));
}

// Distance of neighbouring beams' hits on the line around p.
[[nodiscard]] inline double SpacingAt(const FittedLine& line, const Eigen::Vector2d& laser, const Eigen::Vector2d& p,
                                      double step) {
  const Eigen::Vector2d ray = p - laser;
  const double range = ray.norm();
  const double sin_incidence = std::max(std::abs(line.normal.dot(ray)) / std::max(range, 1e-9), 0.02);
  return range * step / sin_incidence;
}

}  // namespace cairn::slam
