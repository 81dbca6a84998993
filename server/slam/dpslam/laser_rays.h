// One scan as rays in the robot frame, prepared once for all particles: beams without information are left
// out, long ones are cut, and if there are too many, they are thinned evenly. A tilted scan plane is
// projected on the ground as in scan/beam_points.h. Immutable. Precondition: the scan passed ValidateScan.
// Metres.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/sensor/scan.h"
#include "server/slam/dpslam/opacity.h"

namespace cairn::slam {

struct LaserRay {
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();  // Unit vector in the robot frame.
  double length_m = 0.0;
  bool hit = false;  // False: the ray passed at least this far, and the space beyond is unknown.
};

struct LaserRays {
  Eigen::Vector2d origin_robot = Eigen::Vector2d::Zero();
  std::vector<LaserRay> rays;
};

[[nodiscard]] LaserRays RaysOf(const Scan& scan, const OpacityOptions& options);

}  // namespace cairn::slam
