#include "server/slam/motion_models/velocity_model.h"

#include <cmath>

namespace cairn::slam {

VelocityControl InverseVelocity(const Pose2& T_prev_curr) {
  const double chord = T_prev_curr.translation().norm();
  VelocityControl control;
  if (chord < 1e-9) return {0.0, 0.0, T_prev_curr.theta};
  // An arc that leaves along x meets (x, y) after turning by twice the bearing of that point.
  double half = std::atan2(T_prev_curr.y, T_prev_curr.x);
  const bool backwards = std::abs(half) > kPi / 2;
  if (backwards) half = WrapAngle(half + kPi);
  control.w = 2.0 * half;
  control.v = std::abs(half) < 1e-6 ? chord : chord * half / std::sin(half);
  if (backwards) control.v = -control.v;
  control.g = AngleDiff(T_prev_curr.theta, control.w);
  return control;
}

Pose2 ApplyVelocity(const Pose2& T_map_robot, const VelocityControl& control) {
  const double half = 0.5 * control.w;
  const double chord = std::abs(half) < 1e-6 ? control.v : control.v * std::sin(half) / half;
  const double course = T_map_robot.theta + half;  // Lines 4 and 5 by their chord: no division by a small w.
  return {T_map_robot.x + chord * std::cos(course), T_map_robot.y + chord * std::sin(course),
          WrapAngle(T_map_robot.theta + control.w + control.g)};
}

}  // namespace cairn::slam
