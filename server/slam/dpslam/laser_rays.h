// One scan as rays in the robot frame, prepared once for a thousand particles: beams that say nothing are left out,
// long ones cut, and where there are too many they are evenly picked. A tilted scan plane is projected on the ground as
// in scan/beam_points.h. Immutable. Precondition: the scan passed ValidateScan. Metres.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/sensor/scan.h"
#include "server/slam/dpslam/opacity.h"

namespace cairn::slam {

struct LaserRay {
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();  // Of length 1, in robot.
  double length_m = 0.0;
  bool hit = false;  // False: it passed this far, and nothing is known beyond.
};

struct LaserRays {
  Eigen::Vector2d origin_robot = Eigen::Vector2d::Zero();
  std::vector<LaserRay> rays;
};

[[nodiscard]] LaserRays RaysOf(const Scan& scan, const OpacityOptions& options);

}  // namespace cairn::slam
