// How far an estimated trajectory is from the true one: absolute trajectory error at the estimate's stamps, with the
// truth interpolated between its poses. Poses outside the truth's time, or in a gap of it above 0.5 s, are not
// compared. Frames: both in `map`; with Alignment::kSe2 the estimate is first moved rigidly to fit best. Source: Sturm
// et al., IROS 2012 (ATE); Umeyama, PAMI 1991 (alignment, without scale).
#pragma once

#include <cstddef>

#include "common/sensor/trajectory.h"
#include "common/status.h"

namespace cairn::client {

enum class Alignment { kNone, kSe2 };

struct TrajectoryError {
  std::size_t compared = 0;
  std::size_t skipped = 0;
  double way_m = 0.0;  // Length of the true way over the compared time.
  double rmse_m = 0.0;
  double mean_m = 0.0;
  double median_m = 0.0;
  double max_m = 0.0;
  double final_m = 0.0;  // Error of the last pose compared.
  double rmse_rad = 0.0;
  double max_rad = 0.0;
};

// Fails if no pose can be compared.
[[nodiscard]] Result<TrajectoryError> CompareTrajectories(const Trajectory& estimate, const Trajectory& truth,
                                                          Alignment alignment);

}  // namespace cairn::client
