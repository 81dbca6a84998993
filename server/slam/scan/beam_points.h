// The hits of one scan as points in the robot frame, in the order of the beams. Beams without an echo and
// invalid beams are left out; ClassifyRange tells them apart. A tilted scan plane is projected on the ground:
// lengths along the laser's x axis shrink by cos(tilt). The points are not thinned; the motion of the robot during the
// scan is taken out before (deskew.h). Metres and radians. Stateless, thread-safe. Precondition: the scan passed
// ValidateScan.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <span>
#include <vector>

#include "common/sensor/scan.h"

namespace cairn::slam {

// One measured point: `beam` is its index in the scan.
struct BeamPoint {
  Eigen::Vector2d p_robot = Eigen::Vector2d::Zero();
  double range_m = 0.0;
  double bearing_rad = 0.0;  // In the laser frame.
  int beam = 0;
};

[[nodiscard]] std::vector<BeamPoint> PointsOf(const Scan& scan);

[[nodiscard]] inline double BearingOf(const Scan& scan, std::size_t beam) {
  return scan.angle_first_rad + static_cast<double>(beam) * scan.angle_step_rad;
}

// Cosine and sine of the bearing of every beam, in the laser frame. Scans of one lidar have the same, so those of the
// last scan are kept. Not thread-safe.
class BeamDirections {
 public:
  // Valid until the next call.
  [[nodiscard]] std::span<const Eigen::Vector2d> Of(const Scan& scan);

 private:
  double first_rad_ = 0.0, step_rad_ = 0.0;
  std::vector<Eigen::Vector2d> directions_;
};

// True if the beam after the last one would reach the first one again, to within half a step.
[[nodiscard]] bool IsFullTurn(const Scan& scan);

// Scans whose plane is turned about the laser's y axis. A nodding scanner also sees the floor, the ceiling
// and the tops of things. The planar estimator does not use such a scan, however well its points project.
// Small tilts (a bumpy floor, a mount that is a degree off) are projected on the ground. Stateless,
// thread-safe.
[[nodiscard]] inline bool IsTilted(const Scan& scan, double max_tilt_rad) {
  return std::abs(scan.tilt_rad) > max_tilt_rad;
}

// The end of a beam of length `range_m`, in the laser frame seen from above. Lengths along the laser's x axis
// shrink by `cos_tilt`.
[[nodiscard]] inline Eigen::Vector2d OnGround(double range_m, double bearing_rad, double cos_tilt) {
  return {range_m * std::cos(bearing_rad) * cos_tilt, range_m * std::sin(bearing_rad)};
}
// The same, for one of BeamDirections.
[[nodiscard]] inline Eigen::Vector2d OnGround(double range_m, const Eigen::Vector2d& direction, double cos_tilt) {
  return {range_m * direction.x() * cos_tilt, range_m * direction.y()};
}

}  // namespace cairn::slam
