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

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.direction, self.length_m, self.hit);
    archive.Require(self.direction.cwiseAbs().maxCoeff() <= 2.0 && 0.0 <= self.length_m && self.length_m <= 1e4,
                    "a ray");
  }
};

struct LaserRays {
  Eigen::Vector2d origin_robot = Eigen::Vector2d::Zero();
  std::vector<LaserRay> rays;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.origin_robot, self.rays);
  }
};

[[nodiscard]] LaserRays RaysOf(const Scan& scan, const OpacityOptions& options);

}  // namespace cairn::slam
