// The measured motion of a robot from one keyframe to the next, from which a filter predicts. Metres and
// radians.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct StepMotion {
  Pose2 T_prev_curr;  // Result of the front-end: matched, or odometry or a forecast if nothing matched.
  // Covariance of (x, y, theta) of T_prev_curr, in the frame in which the step starts. The noise of the
  // filter's own motion model is not included.
  Eigen::Matrix3d covariance_prev = Eigen::Matrix3d::Zero();
  std::optional<Pose2> T_prev_curr_odom{};  // From odometry alone; empty if odometry is withheld.
  double lambda_m = 0.0;  // Distance forward at the speed of the previous step; 0 if that is not known.

  // The same step as odometry alone measured it, for motion models of odometry; the covariance of the match
  // is left out. Without odometry the step is returned unchanged.
  [[nodiscard]] StepMotion ByOdometry() const {
    return T_prev_curr_odom ? StepMotion{*T_prev_curr_odom, Eigen::Matrix3d::Zero(), T_prev_curr_odom, lambda_m}
                            : *this;
  }
};

}  // namespace cairn::slam
