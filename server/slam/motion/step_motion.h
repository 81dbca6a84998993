// How a robot got from one keyframe to the next, as measured: what a filter predicts from. m, rad.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct StepMotion {
  Pose2 T_prev_curr;  // By the front-end: matched, or odometry or a forecast where nothing matched.
  // Of its (x, y, theta), in the frame it starts from, besides the filter's own motion model.
  Eigen::Matrix3d covariance_prev = Eigen::Matrix3d::Zero();
  std::optional<Pose2> T_prev_curr_odom{};  // By odometry alone; none where it is withheld.
  double lambda_m = 0.0;                    // The way forward at the speed of the step before; 0: not known.

  // The same as odometry alone has it, for models of odometry: what is doubtful about the match plays no part. As it
  // is where there is no odometry.
  [[nodiscard]] StepMotion ByOdometry() const {
    return T_prev_curr_odom ? StepMotion{*T_prev_curr_odom, Eigen::Matrix3d::Zero(), T_prev_curr_odom, lambda_m}
                            : *this;
  }
};

}  // namespace cairn::slam
