#include "server/slam/reckoning/dead_reckoning_filter.h"

#include "server/slam/filters/revisit_innovation.h"
#include "server/slam/motion/odometry_model.h"

namespace cairn::slam {

void ReckonedPath::Advance(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev) {
  DeadReckon(pose_, covariance_, T_prev_curr, drift_.Covariance(T_prev_curr) + covariance_prev);
}

void ReckonedPath::MoveTo(const Pose2& T_map_robot) {
  const Pose2 T_new_old = T_map_robot * pose_.Inverse();
  PosePath moved;
  for (std::size_t k = 0; k < path_.size(); ++k) moved.Append(T_new_old * path_[k]);
  path_ = std::move(moved);
  pose_ = T_map_robot;
}

double ReckonedPath::NisOf(const RevisitObservation& revisit) const {
  Pose2 pose = path_[revisit.keyframe];
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  const auto walk = [&](const Pose2& next) {
    const Pose2 step = Between(pose, next);
    DeadReckon(pose, covariance, step, drift_.Covariance(step));
    pose = next;
  };
  for (std::size_t k = revisit.keyframe + 1; k < path_.size(); ++k) walk(path_[k]);
  walk(pose_);
  const Innovation<3> innovation = InnovateRevisit(path_[revisit.keyframe], pose_, revisit);
  return Nis<3>(innovation.v, innovation.S(covariance));
}

}  // namespace cairn::slam
