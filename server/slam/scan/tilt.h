// Scans whose plane is turned about the laser's y axis. A nodding scanner also sees the floor, the ceiling
// and the tops of things. The planar estimator does not use such a scan, however well its points project.
// Small tilts (a bumpy floor, a mount that is a degree off) are projected on the ground. Stateless,
// thread-safe.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "common/sensor/scan.h"

namespace cairn::slam {

[[nodiscard]] inline bool IsTilted(const Scan& scan, double max_tilt_rad) {
  return std::abs(scan.tilt_rad) > max_tilt_rad;
}

// The end of a beam of length `range_m`, in the laser frame seen from above. Lengths along the laser's x axis
// shrink by `cos_tilt`.
[[nodiscard]] inline Eigen::Vector2d OnGround(double range_m, double bearing_rad, double cos_tilt) {
  return {range_m * std::cos(bearing_rad) * cos_tilt, range_m * std::sin(bearing_rad)};
}

}  // namespace cairn::slam
