// Moves a pose and its covariance along a measured step. Stateless, thread-safe.
// Source: thesis A (4-8)-(4-12), Table 4.2. Corrected: Table 4.2 propagates the pose covariance pv in the
// term where the covariance of the control belongs. Correct is pv = Gv pv Gv' + Gu R_u Gu'. Here R_u is given
// in the frame in which the step starts.
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"

namespace cairn::slam {

// `step_covariance_prev` is the covariance of the step's (x, y, theta), in the frame in which the step
// starts. `covariance` is the covariance of the pose, in `map`.
void DeadReckon(Pose2& T_map_robot, Eigen::Matrix3d& covariance, const Pose2& T_prev_curr,
                const Eigen::Matrix3d& step_covariance_prev);

}  // namespace cairn::slam
