// The inverse odometry motion model. It describes a step as a rotation, a straight line and a second
// rotation, and moves a pose and its covariance along the step. Stateless, thread-safe.
// Source: thesis A (4-5)..(4-12), Table 4.2. Corrected: (4-5) needs atan2; Table 4.2 propagates the pose
// covariance in the term where the covariance of the control belongs. Correct is pv = Gv pv Gv' + Gu R_u Gu'.
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct OdometryControl {
  double rot1 = 0.0;   // First turn, onto the line of travel: at most a right angle either way.
  double trans = 0.0;  // Length of the straight line; negative if the robot drives backwards.
  double rot2 = 0.0;
};

// The control that leads from one pose to the other. If the robot hardly moves, the direction of travel is
// not defined, and rot1 = 0.
[[nodiscard]] OdometryControl InverseOdometry(const Pose2& T_prev_curr);

// The pose after the control, (4-8)..(4-10).
[[nodiscard]] Pose2 ApplyControl(const Pose2& T_map_robot, const OdometryControl& control);

// Derivative of ApplyControl by the pose, Gv (4-11).
[[nodiscard]] Eigen::Matrix3d J_pose_pose(const Pose2& T_map_robot, const OdometryControl& control);

// Moves a pose and its covariance (in `map`) along a measured step. `step_covariance_prev` is the covariance
// of the step's (x, y, theta), in the frame in which the step starts; it takes the place of Gu R_u Gu'.
void DeadReckon(Pose2& T_map_robot, Eigen::Matrix3d& covariance, const Pose2& T_prev_curr,
                const Eigen::Matrix3d& step_covariance_prev);
// The same for many poses: `control` must be InverseOdometry(T_prev_curr).
void DeadReckon(Pose2& T_map_robot, Eigen::Matrix3d& covariance, const Pose2& T_prev_curr,
                const OdometryControl& control, const Eigen::Matrix3d& step_covariance_prev);

}  // namespace cairn::slam
