// A path that only adds up the steps it is given, with its uncertainty. The filters that do not estimate past
// poses use it. Poses in `map`, covariances of (x, y, theta). Not thread-safe.
#pragma once

#include <Eigen/Core>

#include "server/slam/filters/filter.h"
#include "server/slam/motion/motion_noise.h"
#include "server/slam/trail/shared_sequence.h"

namespace cairn::slam {

class ReckonedPath {
 public:
  ReckonedPath(const MotionNoise& drift, const Pose2& T_map_robot_start) : drift_(drift), pose_(T_map_robot_start) {}

  void Advance(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  void Keep() { path_.Append(pose_); }
  // Replaces the present pose and its covariance; past poses are unchanged.
  void Correct(const Pose2& T_map_robot, const Eigen::Matrix3d& covariance) {
    pose_ = T_map_robot;
    covariance_ = covariance;
  }
  // Moves the whole path rigidly so that the present pose becomes this one.
  void MoveTo(const Pose2& T_map_robot);

  // Squared Mahalanobis distance (three degrees of freedom) of a revisit from the steps since that keyframe.
  // Changes nothing. Time is linear in the number of keyframes since.
  [[nodiscard]] double NisOf(const RevisitObservation& revisit) const;

  [[nodiscard]] const Pose2& T_map_robot() const { return pose_; }
  [[nodiscard]] const Eigen::Matrix3d& covariance() const { return covariance_; }
  [[nodiscard]] const SharedSequence<Pose2>& path() const { return path_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.pose_, self.covariance_, self.path_);
  }

 private:
  MotionNoise drift_;
  Pose2 pose_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  SharedSequence<Pose2> path_;
};

}  // namespace cairn::slam
