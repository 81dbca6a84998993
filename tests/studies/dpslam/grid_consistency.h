// Tests whether DP-SLAM's stated uncertainty is right. The robot drives many times through a simulated room,
// with different seeds and noisy scans, and the errors of its odometry are exactly those of the filter's
// model. (The study of the landmark filters, filters/consistency.h, has no ranges.) Source: Bar-Shalom, Li,
// Kirubarajan 2001, 5.4 (NEES and its bounds).
#pragma once

#include <cstdint>
#include <vector>

namespace cairn::studies {

struct GridConsistencyOptions {
  bool hierarchical = false;
  int runs = 100;
  std::int64_t particles = 100;  // On each level.
  std::uint64_t first_seed = 1;
};

// Averages over all runs at one place of the way.
struct GridConsistencyPoint {
  double travelled_m = 0.0;
  // NEES of (x, y, theta): 3 if the filter is consistent, more if it states too small an uncertainty.
  double nees = 0.0;
  double effective_sample_size = 0.0;
  double position_error_m = 0.0;  // Root mean square ...
  double odometry_error_m = 0.0;  // ... and of odometry alone.
};

struct GridConsistency {
  std::vector<GridConsistencyPoint> points;
  double nees_low = 0.0;  // 95 % of consistent filters lie between, at every point.
  double nees_high = 0.0;
  double nees_mean = 0.0;
};

[[nodiscard]] GridConsistency StudyGridConsistency(const GridConsistencyOptions& options);

}  // namespace cairn::studies
