// Accumulates the motion that no scan measured: the part that is known by odometry or by a forecast alone. Along a
// corridor this is the position along it, although the scan matches. It gives the uncertainty of a step between
// keyframes in addition to the drift of matching, and decides when the robot counts as lost. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <utility>

#include "common/geometry/rotated_covariance.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/tracking/front_end.h"

namespace cairn::slam {

// What no scan has measured of the motion since a pose `from`, after one more step of a robot that has odometry: the
// covariance of (x, y, theta) in the frame of the robot at `from`; `before` is that before the step. A match shows
// where the robot is, but for the direction that it leaves open. There it has moved the position from that of odometry
// by a gain for which only the noise of this step counted (FrontEnd::Align), and so much of the doubt before is left.
[[nodiscard]] inline Eigen::Matrix3d UnmeasuredAfter(const Eigen::Matrix3d& before, const TrackStep& step,
                                                     const Pose2& T_track_from, const OdometryNoise& noise) {
  const Eigen::Matrix3d of_step = noise.Covariance(step.T_prev_curr_odom);
  Eigen::Matrix3d all = before + of_step;
  if (!step.matched) return all;
  const Eigen::Vector2d open = T_track_from.rotation().transpose() * step.open_direction;
  double along = open.dot(all.topLeftCorner<2, 2>() * open);
  if (step.open_information > 0.0) {
    const double gain = GainAlong(of_step(0, 0), step.open_information);
    along = (1.0 - gain) * (1.0 - gain) * along + gain * gain / step.open_information;
  }
  all.setZero();
  all.topLeftCorner<2, 2>() = along * open * open.transpose();
  return all;
}

class BlindMotion {
 public:
  // `noise` is the noise of motion known by odometry alone. Without odometry the front-end itself reports the
  // covariance of what it did not measure.
  BlindMotion(const OdometryNoise& noise, bool use_odometry, double lost_after_m)
      : noise_(noise), use_odometry_(use_odometry), lost_after_m_(lost_after_m) {}

  void UseOdometry(bool use) { use_odometry_ = use; }
  // `T_track_keyframe` is the pose of the last keyframe.
  void Add(const TrackStep& step, const Pose2& T_track_keyframe) {
    unmatched_m_ = step.matched ? 0.0 : unmatched_m_ + step.moved_m;
    if (use_odometry_) {
      covariance_ = UnmeasuredAfter(covariance_, step, T_track_keyframe, noise_);
      return;
    }
    covariance_ += Rotated(step.forecast_covariance, -T_track_keyframe.theta);
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
  OdometryNoise noise_;
  bool use_odometry_;
  double lost_after_m_;
  double unmatched_m_ = 0.0;  // Distance travelled since the last match.
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
};

}  // namespace cairn::slam
