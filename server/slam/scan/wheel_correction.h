// Corrects steps of odometry for wheels that are larger, or farther apart, than the robot believes. Plain values,
// stateless.
// Source: the two systematic errors of Borenstein and Feng 1996 (wheel base, unequal wheels), and the scale of both.
#pragma once

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct WheelCorrection {
  double wheel_scale = 1.0;  // True way over the way that odometry reports.
  double turn_scale = 1.0;   // True turn over the turn that odometry reports: wheel_scale over the error of the track.
  double turn_per_m = 0.0;   // Turn to the left that odometry does not notice, in rad per metre: unequal wheels.

  bool operator==(const WheelCorrection&) const = default;

  // The true step for a short step of odometry, T_prev_curr in the robot frame.
  [[nodiscard]] Pose2 Apply(const Pose2& step) const {
    const double turn = turn_scale * step.theta + turn_per_m * step.x;
    const Pose2 half{0.0, 0.0, 0.5 * (turn - step.theta)};  // The chord turns by half of what the heading does.
    const Eigen::Vector2d moved = wheel_scale * (half * step.translation());
    return {moved.x(), moved.y(), WrapAngle(turn)};
  }
};

}  // namespace cairn::slam
