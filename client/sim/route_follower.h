// Steers a robot from waypoint to waypoint within limits of speed and acceleration: turns on the spot at sharp
// corners, drives smoothly through flat ones. Not a planner: it sees no obstacle, routes are drawn clear of walls.
// Frame: `map`.
#pragma once

#include <cstddef>
#include <vector>

#include "client/sim/laser.h"
#include "common/geometry/pose2.h"

namespace cairn::sim {

struct DriveOptions {
  double speed_m_s = 0.9;
  double acceleration_m_s2 = 0.8;
  double turn_rad_s = 1.2;
  double turn_acceleration_rad_s2 = 3.0;
  double arrival_m = 0.25;  // A waypoint counts as reached this close. Larger cuts corners more.
};
[[nodiscard]] Result<void> Validate(const DriveOptions& options);

class RouteFollower {
 public:
  // A closed route of at least 2 points; `target` is the index of the waypoint to drive to first.
  RouteFollower(std::vector<Eigen::Vector2d> waypoints_map, std::size_t target, const DriveOptions& options);

  // The velocities for the next `seconds`.
  [[nodiscard]] Twist Steer(const Pose2& T_map_robot, double seconds);
  // The same while the robot brakes and stands.
  [[nodiscard]] Twist Brake(double seconds);

 private:
  [[nodiscard]] double CornerSpeed() const;
  [[nodiscard]] Twist Towards(const Twist& wanted, double seconds);

  const std::vector<Eigen::Vector2d> waypoints_map_;
  const DriveOptions options_;
  std::size_t target_;
  Twist twist_;
};

}  // namespace cairn::sim
