// Accumulates the motion that no scan measured: the part that is known by odometry or by a forecast alone. Along a
// corridor this is the position along it, although the scan matches. It gives the uncertainty of a step between
// keyframes in addition to the drift of matching, and decides when the robot counts as lost. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <utility>

#include "server/slam/matching/match_result.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/tracking/front_end.h"

namespace cairn::slam {

class BlindMotion {
 public:
  // `noise` is the noise of motion known by odometry alone. Without odometry the front-end itself reports the
  // covariance of what it did not measure.
  BlindMotion(const OdometryNoise& noise, bool use_odometry, double lost_after_m)
      : noise_(noise), use_odometry_(use_odometry), lost_after_m_(lost_after_m) {}

  // `T_track_keyframe` is the pose of the last keyframe.
  void Add(const TrackStep& step, const Pose2& T_track_keyframe) {
    unmatched_m_ = step.matched ? 0.0 : unmatched_m_ + step.moved_m;
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    R.topLeftCorner<2, 2>() = T_track_keyframe.rotation().transpose();
    if (!use_odometry_) {
      covariance_ += R * step.forecast_covariance * R.transpose();
      return;
    }
    covariance_ += noise_.Covariance(step.T_prev_curr_odom);
    if (step.matched) KeepUnseen(R.topLeftCorner<2, 2>() * step.open_direction, step.open_information);
  }

  // Returns the covariance of the motion since the last call: (x, y, theta) in the last keyframe.
  [[nodiscard]] Eigen::Matrix3d TakeCovariance() { return std::exchange(covariance_, Eigen::Matrix3d::Zero()); }
  // The step since the last call leads to where the robot was found again.
  void Found(const Eigen::Matrix3d& covariance) {
    unmatched_m_ = 0.0;
    covariance_ = covariance;
  }
  // Whether the robot has travelled too far since the last match, counting `more_m` in addition.
  [[nodiscard]] bool Lost(double more_m = 0.0) const { return unmatched_m_ + more_m > lost_after_m_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.unmatched_m_, self.covariance_);
  }

 private:
  // A match shows where the robot is relative to the keyframe, but little or nothing of the position along `open`,
  // which is zero if there is no such direction.
  void KeepUnseen(const Eigen::Vector2d& open, double information) {
    const double along = open.dot(covariance_.topLeftCorner<2, 2>() * open);
    covariance_.setZero();
    covariance_.topLeftCorner<2, 2>() = VarianceAfter(along, information) * open * open.transpose();
  }

  OdometryNoise noise_;
  bool use_odometry_;
  double lost_after_m_;
  double unmatched_m_ = 0.0;  // Distance travelled since the last match.
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
};

}  // namespace cairn::slam
