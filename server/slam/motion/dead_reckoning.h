// A pose and its uncertainty carried along a measured step. Stateless, thread-safe.
// Source: thesis A (4-8)-(4-12), Table 4.2. Corrected: Table 4.2 propagates pv where the control noise belongs:
// pv = Gv pv Gv' + Gu R_u Gu'; here R_u is known in the frame the step starts from.
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"

namespace cairn::slam {

// `step_covariance_prev`: of the step's (x, y, theta), in the frame it starts from; `covariance`: of the pose, in map.
void DeadReckon(Pose2& T_map_robot, Eigen::Matrix3d& covariance, const Pose2& T_prev_curr,
                const Eigen::Matrix3d& step_covariance_prev);

}  // namespace cairn::slam
