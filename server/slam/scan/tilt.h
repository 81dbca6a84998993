// Scans whose plane is turned about the laser's y axis. A scanner that nods sees floor, ceiling and the tops of things:
// for the planar estimator such a scan is no evidence, however well its points project. Small tilts (a bumpy floor, a
// mount a degree off) are projected on the ground. Stateless, thread-safe.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "common/sensor/scan.h"

namespace cairn::slam {

[[nodiscard]] inline bool IsTilted(const Scan& scan, double max_tilt_rad) {
  return std::abs(scan.tilt_rad) > max_tilt_rad;
}

// Where a beam of `range_m` ends, in the laser's frame seen from above: lengths along its x axis shrink.
[[nodiscard]] inline Eigen::Vector2d OnGround(double range_m, double bearing_rad, double cos_tilt) {
  return {range_m * std::cos(bearing_rad) * cos_tilt, range_m * std::sin(bearing_rad)};
}

}  // namespace cairn::slam
