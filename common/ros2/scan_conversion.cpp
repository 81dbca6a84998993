#include "common/ros2/scan_conversion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "common/ros2/frame_tree.h"

namespace cairn::ros2 {

Result<Mounting> MountingOf(const Eigen::Isometry3d& T_base_laser) {
  constexpr double kMaxLean = 0.17;   // Sine of 10 degrees.
  constexpr double kMaxSteep = 0.94;  // Sine of 70 degrees.
  const Eigen::Matrix3d axes = T_base_laser.linear();
  const double forward_z = axes(2, 0), left_z = axes(2, 1), up_z = axes(2, 2);
  if (!(std::abs(left_z) <= kMaxLean))
    return Fail(StatusCode::kInvalidArgument, "its scan plane leans to the side by " +
                                                  std::to_string(std::lround(Degrees(std::asin(left_z)))) + " degrees");
  if (!(std::abs(forward_z) <= kMaxSteep)) return Fail(StatusCode::kInvalidArgument, "it looks up or down too steeply");
  return Mounting{PlanarPart(T_base_laser), std::asin(-forward_z), up_z < 0.0};
}

Scan ScanOf(LaserScan&& message, const Mounting& mounting) {
  Scan scan;
  scan.stamp = message.header.stamp;
  const double side = mounting.upside_down ? -1.0 : 1.0;
  scan.angle_first_rad = side * message.angle_min;
  scan.angle_step_rad = side * message.angle_increment;
  scan.range_min_m = message.range_min;
  scan.range_max_m = message.range_max;
  scan.tilt_rad = mounting.tilt_rad;
  scan.T_robot_laser = mounting.T_robot_laser;
  scan.beam_period_s = message.time_increment;
  const auto gaps = static_cast<double>(std::max<std::size_t>(message.ranges.size(), 2) - 1);
  if (message.scan_time > 0.0) {
    const double longest_s = message.scan_time / gaps;
    scan.beam_period_s = std::clamp(scan.beam_period_s, -longest_s, longest_s);
  }
  scan.ranges_m = std::move(message.ranges);
  for (float& range : scan.ranges_m) {
    if (std::isfinite(range) && range > scan.range_max_m) range = std::numeric_limits<float>::quiet_NaN();
  }
  OrderByTime(scan);
  return scan;
}

}  // namespace cairn::ros2
