#include "server/slam/motion/dead_reckoning.h"

#include "server/slam/motion/odometry_model.h"

namespace cairn::slam {

void DeadReckon(Pose2& T_map_robot, Eigen::Matrix3d& covariance, const Pose2& T_prev_curr,
                const Eigen::Matrix3d& step_covariance_prev) {
  const OdometryControl control = InverseOdometry(T_prev_curr);
  const Eigen::Matrix3d Gv = J_pose_pose(T_map_robot, control);
  const Eigen::Matrix3d J_step = J_compose_right(T_map_robot, T_prev_curr);
  covariance = Gv * covariance * Gv.transpose() + J_step * step_covariance_prev * J_step.transpose();
  T_map_robot = ApplyControl(T_map_robot, control);
}

}  // namespace cairn::slam
