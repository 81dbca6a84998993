// How crisp the map is that a trajectory makes of its log: a figure where there is no truth. All scans are
// put down at their poses; around every point the points within 0.3 m have a covariance. Compare trajectories
// of one log only: the figures depend on the place. A wall doubled farther apart than 0.3 m is not seen.
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
