// Which scans look out of the plane. A scanner that nods sees floor, ceiling and the tops of things: for the planar
// estimator such a scan is no evidence, however well its points project. Small tilts (a bumpy floor, a mount a degree
// off) are projected by PointsOf instead.
#pragma once

#include <cmath>

#include "common/sensor/scan.h"

namespace cairn::slam {

[[nodiscard]] inline bool IsTilted(const Scan& scan, double max_tilt_rad) {
  return std::abs(scan.tilt_rad) > max_tilt_rad;
}

}  // namespace cairn::slam
