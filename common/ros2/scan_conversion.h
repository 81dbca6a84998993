// A LaserScan of ROS 2 as a scan of Cairn's: how the lidar is mounted, in which order of time its rays are, and what
// its ranges mean (REP 117). Stateless, thread-safe.
#pragma once

#include <Eigen/Geometry>

#include "common/ros2/messages.h"
#include "common/sensor/scan.h"
#include "common/status.h"

namespace cairn::ros2 {

struct Mounting {
  Pose2 T_robot_laser;
  double tilt_rad = 0.0;     // As Scan::tilt_rad.
  bool upside_down = false;  // The lidar's z axis points down: seen from above it turns the other way.
};

// Fails for a lidar whose scan plane leans to its side: Cairn maps one plane.
[[nodiscard]] Result<Mounting> MountingOf(const Eigen::Isometry3d& T_base_laser);

// The scan without its number; it is not valid yet (ValidateScan).
// - The stamp of ROS is that of the first ray, and time_increment is the time between two of them: Cairn's meaning.
//   Drivers that say a longer turn than scan_time mean scan_time.
// - REP 117: -Inf is an object that is too near, NaN no measurement, +Inf nothing up to range_max. Finite ranges
//   outside range_min..range_max are to be discarded, also those beyond range_max.
[[nodiscard]] Scan ScanOf(LaserScan&& message, const Mounting& mounting);

}  // namespace cairn::ros2
