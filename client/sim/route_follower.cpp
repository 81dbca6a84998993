#include "client/sim/route_follower.h"

#include <algorithm>
#include <cmath>

namespace cairn::sim {

Result<void> Validate(const DriveOptions& o) {
  for (const double value : {o.speed_m_s, o.acceleration_m_s2, o.turn_rad_s, o.turn_acceleration_rad_s2, o.arrival_m}) {
    if (!(value > 0.0 && value <= 100.0)) {
      return Fail(StatusCode::kInvalidArgument,
                  "drive: speeds, accelerations and arrival must be above 0, at most 100");
    }
  }
  return {};
}

RouteFollower::RouteFollower(std::vector<Eigen::Vector2d> waypoints_map, std::size_t target,
                             const DriveOptions& options)
    : waypoints_map_(std::move(waypoints_map)), options_(options), target_(target % waypoints_map_.size()) {}

double RouteFollower::CornerSpeed() const {
  const std::size_t n = waypoints_map_.size();
  const Eigen::Vector2d in = waypoints_map_[target_] - waypoints_map_[(target_ + n - 1) % n];
  const Eigen::Vector2d out = waypoints_map_[(target_ + 1) % n] - waypoints_map_[target_];
  const double turn = std::abs(AngleDiff(std::atan2(out.y(), out.x()), std::atan2(in.y(), in.x())));
  return options_.speed_m_s * std::clamp(1.0 - turn / 1.2, 0.15, 1.0);
}

Twist RouteFollower::Steer(const Pose2& T_map_robot, double seconds) {
  Eigen::Vector2d way = waypoints_map_[target_] - T_map_robot.translation();
  if (way.norm() < options_.arrival_m) {
    target_ = (target_ + 1) % waypoints_map_.size();
    way = waypoints_map_[target_] - T_map_robot.translation();
  }
  const double error = AngleDiff(std::atan2(way.y(), way.x()), T_map_robot.theta);

  // Never faster than it could still stop turning, or slow down to the corner, at the right place.
  double turn = std::min(
      {2.5 * std::abs(error), std::sqrt(2 * options_.turn_acceleration_rad_s2 * std::abs(error)), options_.turn_rad_s});
  turn = std::copysign(turn, error);
  const double brake_way = std::max(0.0, way.norm() - options_.arrival_m), corner = CornerSpeed();
  double speed = std::min(options_.speed_m_s, std::sqrt(corner * corner + 2 * options_.acceleration_m_s2 * brake_way));
  speed *= std::abs(error) < 1.0 ? std::pow(std::cos(error), 4) : 0.0;

  return Towards({speed, turn}, seconds);
}

Twist RouteFollower::Brake(double seconds) {
  return Towards({}, seconds);
}

Twist RouteFollower::Towards(const Twist& wanted, double seconds) {
  const double dv = options_.acceleration_m_s2 * seconds, dw = options_.turn_acceleration_rad_s2 * seconds;
  twist_.speed_m_s += std::clamp(wanted.speed_m_s - twist_.speed_m_s, -dv, dv);
  twist_.turn_rad_s += std::clamp(wanted.turn_rad_s - twist_.turn_rad_s, -dw, dw);
  return twist_;
}

}  // namespace cairn::sim
