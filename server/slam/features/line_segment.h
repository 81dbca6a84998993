// A line during extraction: the hits that belong to it, as indices into a Sweep, and the line fitted through
// them. Frames and units are those of Sweep. Used only inside line extraction.
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
  int end = 0;    // One past the last hit; above size() if the segment crosses the seam of a full turn.
  PointSums sums;
  FittedLine line;
  bool alive = true;

  [[nodiscard]] int count() const { return static_cast<int>(sums.n); }
};

// Largest distance of a hit from the line to which it belongs.
[[nodiscard]] inline double SplitDistance(double range_m, const LineOptions& options) {
  return options.split_m + options.split_per_m * range_m;
}

// Largest distance of a hit at the end of a line from the line through its other hits. It is smaller than
// SplitDistance, because a hit on the next wall just behind a corner would change the slope of this line
// most.
[[nodiscard]] inline double EndDistance(const FittedLine& others, double range_m, const LineOptions& options) {
  return std::min(SplitDistance(range_m, options), std::max(3.0 * others.deviation, 2.0 * options.range_sigma_m));
}

// Distance between the hits of neighbouring beams on the line near `p`.
[[nodiscard]] inline double SpacingAt(const FittedLine& line, const Eigen::Vector2d& laser, const Eigen::Vector2d& p,
                                      double step) {
  const Eigen::Vector2d ray = p - laser;
  const double range = ray.norm();
  const double sin_incidence = std::max(std::abs(line.normal.dot(ray)) / std::max(range, 1e-9), 0.02);
  return range * step / sin_incidence;
}

}  // namespace cairn::slam
