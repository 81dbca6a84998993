// How wrong a particle filter's path may be, kept apart from its particles. What a set has resampled away is gone from
// its spread, not from its error: all its paths may share a mistake. So a hundred examples of that error are carried
// along: they drift as the robot does, stay with the keyframes they were made at, and the robot's is pulled towards
// that of an old keyframe wherever an observation ties the two. Resampling adds its own: a mean over fewer ancestors.
// The past is not learnt about, as it is not by a filter whose paths have become one; where it still has many, the
// examples are a little too large.
// An error is a small motion of the map's frame (x, y, theta), T_map_true = Exp(error) * T_map_believed: one that two
// poses share moves neither against the other, nor does it change as the robot drives on. Changes nothing the filter
// does. Memory: 1.2 kB a keyframe. Not thread-safe. Deterministic for a seed.
// Source: Evensen 1994, Burgers et al. 1998 (ensemble Kalman filter); Schmidt 1966 (states considered, not estimated);
// Houtekamer, Mitchell 1998 (each half gains by the other, or the ensemble would flatter itself).
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cstdint>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/filters/innovation.h"
#include "server/slam/filters/resampling.h"
#include "server/slam/motion/motion_sampling.h"

namespace cairn::slam {

class ErrorEnsemble {
 public:
  explicit ErrorEnsemble(std::uint64_t seed) : rng_(seed) {}

  // A step of the robot; `covariance_prev` of (x, y, theta) in the frame it starts from.
  void Move(const Pose2& T_map_prev, const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  // A step with the noise of the motion model. Besides Move, which adds what comes on top.
  void MoveBySampling(const Pose2& T_map_prev, const StepMotion& step, const MotionSampling& motion);
  // An observation of something first seen from an old keyframe, or of the keyframe itself. REQUIRES: it was kept.
  template <int N>
  void Tie(std::size_t keyframe, const Pose2& T_map_robot, const Innovation<N>& innovation);
  // The particles were resampled and have lost this share of their spread to common parents.
  void Resample(double lost);
  // The robot's error joins the path. `spread_share`: how much of its variance the particles still spread over.
  void Keep(double spread_share) { path_.push_back({robot_, spread_share}); }
  // The path is known from now on; the robot's pose as well as this, (x, y, theta) in map.
  void Rebase(std::size_t keyframes, const Pose2& T_map_robot, const Eigen::Matrix3d& covariance);

  // Of the robot's pose, (x, y, theta) in map.
  [[nodiscard]] Eigen::Matrix3d covariance(const Pose2& T_map_robot) const;

 private:
  static constexpr int kMembers = 100;
  static constexpr int kHalf = kMembers / 2;
  using Errors = Eigen::Matrix<float, 3, kMembers>;
  struct Kept {
    Errors errors;
    double spread_share = 0.0;
  };

  // What an error does to a pose: (x, y, theta) in map.
  static Eigen::Matrix3d J_pose_error(const Pose2& T_map_robot);
  template <typename Matrix>
  static auto Centred(const Matrix& columns) {
    return (columns.colwise() - columns.rowwise().mean()).eval();
  }
  void Disturb(const Pose2& T_map_robot, const Eigen::Matrix3d& covariance);
  void LoseAncestors(Errors& errors, double share, int partner) const;

  Rng rng_;
  Errors robot_ = Errors::Zero();
  std::vector<Kept> path_;
};

template <int N>
void ErrorEnsemble::Tie(std::size_t keyframe, const Pose2& T_map_robot, const Innovation<N>& innovation) {
  using Matrix = Eigen::Matrix<float, N, N>;
  const Eigen::Matrix<float, N, 3> J_z_error = (innovation.J_z_pose * J_pose_error(T_map_robot)).template cast<float>();
  const Matrix R = innovation.S_known_pose.template cast<float>();
  const Matrix root = R.llt().matrixL();
  const Errors since = robot_ - path_[keyframe].errors;
  const Eigen::Matrix<float, N, kMembers> z = J_z_error * since;
  const auto gain = [&](int begin) -> Eigen::Matrix<float, 3, N> {
    const auto spread = Centred(z.template middleCols<kHalf>(begin));
    const Matrix S = R + spread * spread.transpose() / (kHalf - 1.0F);
    return since.middleCols<kHalf>(begin) * spread.transpose() / (kHalf - 1.0F) * S.inverse();
  };
  const std::array<Eigen::Matrix<float, 3, N>, 2> K = {gain(kHalf), gain(0)};
  for (int j = 0; j < kMembers; ++j) {
    Eigen::Matrix<float, N, 1> noise;
    for (int n = 0; n < N; ++n) noise[n] = static_cast<float>(NormalDraw(rng_));
    robot_.col(j) -= K[static_cast<std::size_t>(j / kHalf)] * (z.col(j) + root * noise);
  }
}

}  // namespace cairn::slam
