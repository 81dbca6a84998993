#include "server/slam/motion/odometry_model.h"

#include <cmath>

namespace cairn::slam {

OdometryControl InverseOdometry(const Pose2& T_prev_curr) {
  OdometryControl control;
  control.trans = T_prev_curr.translation().norm();
  if (control.trans > 1e-4) {
    control.rot1 = std::atan2(T_prev_curr.y, T_prev_curr.x);
    // The robot drove backwards; it did not turn round and drive forwards.
    if (std::abs(control.rot1) > kPi / 2) {
      control.rot1 = WrapAngle(control.rot1 + kPi);
      control.trans = -control.trans;
    }
  } else {
    control.trans = T_prev_curr.x;
  }
  control.rot2 = AngleDiff(T_prev_curr.theta, control.rot1);
  return control;
}

Pose2 ApplyControl(const Pose2& T_map_robot, const OdometryControl& control) {
  const double course = T_map_robot.theta + control.rot1;
  return {T_map_robot.x + control.trans * std::cos(course), T_map_robot.y + control.trans * std::sin(course),
          WrapAngle(course + control.rot2)};
}

Eigen::Matrix3d J_pose_pose(const Pose2& T_map_robot, const OdometryControl& control) {
  const double course = T_map_robot.theta + control.rot1;
  Eigen::Matrix3d Gv = Eigen::Matrix3d::Identity();
  Gv(0, 2) = -control.trans * std::sin(course);
  Gv(1, 2) = control.trans * std::cos(course);
  return Gv;
}

void DeadReckon(Pose2& T_map_robot, Eigen::Matrix3d& covariance, const Pose2& T_prev_curr,
                const Eigen::Matrix3d& step_covariance_prev) {
  DeadReckon(T_map_robot, covariance, T_prev_curr, InverseOdometry(T_prev_curr), step_covariance_prev);
}

void DeadReckon(Pose2& T_map_robot, Eigen::Matrix3d& covariance, const Pose2& T_prev_curr,
                const OdometryControl& control, const Eigen::Matrix3d& step_covariance_prev) {
  const Eigen::Matrix3d Gv = J_pose_pose(T_map_robot, control);
  const Eigen::Matrix3d J_step = J_compose_right(T_map_robot, T_prev_curr);
  covariance = Gv * covariance * Gv.transpose() + J_step * step_covariance_prev * J_step.transpose();
  T_map_robot = ApplyControl(T_map_robot, control);
}

}  // namespace cairn::slam
