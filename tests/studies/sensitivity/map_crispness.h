// How crisp the map along a trajectory is, as a measure for logs without a truth. All points of all scans are placed at
// the poses of the trajectory, and the covariance of the points within 0.3 m around each point is computed. Compare
// trajectories of one log only: the figures depend on the place. A wall doubled farther apart than 0.3 m is not seen.
// Stateless, deterministic. Source: mean map entropy and mean plane variance, Razlaw et al. 2015; Droeschel
// and Behnke 2018.
#pragma once

#include "tests/studies/logs.h"

namespace cairn::studies {

struct MapCrispness {
  double blur_m = 0.0;       // Side of the square as large as the normal distributions, whose mean entropy it is.
  double thickness_m = 0.0;  // Median standard deviation across what lies around a point.
};

// Scans without a pose at their stamp are left out; NaN where nothing could be compared.
[[nodiscard]] MapCrispness CrispnessOf(const StudyLog& log, const Trajectory& trajectory);

}  // namespace cairn::studies
