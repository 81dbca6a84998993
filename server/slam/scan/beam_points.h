// The hits of one scan as points in the robot frame, in the order of the beams. Beams without an echo and
// invalid beams are left out; ClassifyRange tells them apart. A tilted scan plane is projected on the ground:
// lengths along the laser's x axis shrink by cos(tilt). The points are neither thinned nor deskewed. Metres
// and radians. Stateless, thread-safe.
// Precondition: the scan passed ValidateScan.
#pragma once

#include <Eigen/Core>
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

// True if the beam after the last one would reach the first one again, to within half a step.
[[nodiscard]] bool IsFullTurn(const Scan& scan);

}  // namespace cairn::slam
