// A rectangular room with a box in it, seen by a perfect scanner: input for tests of the rooms above slam. Walls at
// x = +-6 m and y = +-4 m, the box from (1, 1) to (2.5, 2). Scans have 181 beams over 180 degrees.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"

namespace cairn::server::testing {

inline constexpr Stamp kScanPeriod = kNanosPerSecond / 10;

// Distance along a ray to the nearest of the axis-parallel segments that bound a rectangle.
inline double RayToRectangle(const Pose2& ray, double x_min, double y_min, double x_max, double y_max) {
  double nearest = std::numeric_limits<double>::infinity();
  const double dx = std::cos(ray.theta), dy = std::sin(ray.theta);
  for (const double x : {x_min, x_max}) {
    const double t = (x - ray.x) / dx, y = ray.y + t * dy;
    if (t > 1e-9 && y >= y_min && y <= y_max) nearest = std::min(nearest, t);
  }
  for (const double y : {y_min, y_max}) {
    const double t = (y - ray.y) / dy, x = ray.x + t * dx;
    if (t > 1e-9 && x >= x_min && x <= x_max) nearest = std::min(nearest, t);
  }
  return nearest;
}

// The robot's true way: around the box, 0.05 m a step, beginning at the origin.
inline Pose2 TruePose(int step) {
  const double angle = 0.025 * step;
  return {2.0 * std::sin(angle), 2.0 * (std::cos(angle) - 1.0), WrapAngle(-angle)};
}

inline Scan RoomScan(int step, const Pose2& T_world_robot) {
  Scan scan;
  scan.sequence = static_cast<std::uint64_t>(step) + 1;
  scan.stamp = (step + 1) * kScanPeriod;
  scan.angle_first_rad = -kPi / 2;
  scan.angle_step_rad = kPi / 180;
  scan.range_max_m = 20.0;
  for (int i = 0; i <= 180; ++i) {
    Pose2 ray = T_world_robot;
    ray.theta += scan.angle_first_rad + i * scan.angle_step_rad;
    scan.ranges_m.push_back(
        static_cast<float>(std::min(RayToRectangle(ray, -6, -4, 6, 4), RayToRectangle(ray, 1, 1, 2.5, 2))));
  }
  return scan;
}

inline Scan RoomScan(int step) {
  return RoomScan(step, TruePose(step));
}

inline Odometry RoomOdometry(int step) {
  return {.sequence = static_cast<std::uint64_t>(step) + 1,
          .stamp = (step + 1) * kScanPeriod,
          .T_odom_robot = TruePose(step)};
}

}  // namespace cairn::server::testing
