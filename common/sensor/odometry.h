// Wheel odometry: the robot's pose in its own odometry frame, continuous and drifting. Plain value; peers' values pass
// ValidateOdometry before use.
#pragma once

#include <cstdint>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"
#include "common/status.h"

namespace cairn {

struct Odometry {
  std::uint64_t sequence = 0;
  Stamp stamp = 0;
  Pose2 T_odom_robot;
};

// Finite, |x|,|y| <= 1e7 m. Returns why not.
[[nodiscard]] Result<void> ValidateOdometry(const Odometry& odometry);

}  // namespace cairn
