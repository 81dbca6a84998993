// The inverse odometry motion model: a step as rotation, straight line, rotation, and how a pose and its uncertainty go
// along with it. Stateless, thread-safe.
// Source: thesis A (4-5)..(4-12), Table 4.2. Corrected: (4-5) needs atan2; Table 4.2 propagates the pose covariance
// where the control noise belongs: pv = Gv pv Gv' + Gu R_u Gu'.
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct OdometryControl {
  double rot1 = 0.0;   // Turn towards the line of travel; driving backwards it stays the smaller turn.
  double trans = 0.0;  // Signed: negative backwards.
  double rot2 = 0.0;
};

// The control that leads from one pose to the other. Where the robot hardly moves the direction of travel means
// nothing: then rot1 = 0.
[[nodiscard]] OdometryControl InverseOdometry(const Pose2& T_prev_curr);

// (4-8)..(4-10).
[[nodiscard]] Pose2 ApplyControl(const Pose2& T_map_robot, const OdometryControl& control);

// Gv (4-11) and Gu (4-12) at a pose.
[[nodiscard]] Eigen::Matrix3d J_pose_pose(const Pose2& T_map_robot, const OdometryControl& control);
[[nodiscard]] Eigen::Matrix3d J_pose_control(const Pose2& T_map_robot, const OdometryControl& control);

}  // namespace cairn::slam
