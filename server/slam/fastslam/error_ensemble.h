// The error of a particle filter's path, estimated apart from its particles. Resampling reduces the spread of
// a particle set but not its error: all its paths may share a mistake. Therefore a hundred samples of that
// error (the members of the ensemble) are carried along. They drift as the robot does, and a copy is stored
// with every keyframe. When an observation constrains the robot relative to an old keyframe, the robot's error is
// corrected towards that of the keyframe. Resampling adds an error of its own, because the mean is then taken over
// fewer ancestors.
// An observation does not change the stored errors of past poses. That is right for a filter whose particles
// share one path there; where they still have many paths, the estimated error is a little too large.
// An error is a small motion (x, y, theta) of the map's frame: T_map_true = Exp(error) * T_map_believed. An
// error that two poses share does not change their relative pose, and it stays the same as the robot drives
// on. The ensemble does not influence the filter. Memory: 1.2 kB per keyframe. Not thread-safe. Deterministic
// for a given seed.
// Source: Evensen 1994, Burgers et al. 1998 (ensemble Kalman filter); Schmidt 1966 (states considered, not
// estimated); Houtekamer, Mitchell 1998 (each half of the ensemble is updated with the gain from the other
// half, because the ensemble would otherwise underestimate its error).
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/fastslam/motion_sampler.h"
#include "server/slam/landmarks/innovation.h"
#include "server/slam/random/resampling.h"
#include "server/slam/state/frozen_blocks.h"
#include "server/slam/trail/retirement.h"

namespace cairn::slam {

class ErrorEnsemble {
 public:
  explicit ErrorEnsemble(std::uint64_t seed) : rng_(seed) {}

  // Adds the noise of a step of the robot. `covariance_prev` is the covariance of its (x, y, theta), in the
  // frame in which it starts.
  void Move(const Pose2& T_map_prev, const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  // Adds the noise of a step as the motion model samples it. Any further noise of the step is added by Move.
  void MoveBySampling(const Pose2& T_map_prev, const StepMotion& step, const MotionSampler& sampler);
  // Replaces the robot's error by one with this covariance of the pose, (x, y, theta) in map, that has nothing to do
  // with those of past keyframes.
  void Begin(const Pose2& T_map_robot, const Eigen::Matrix3d& covariance) {
    robot_.setZero();
    Disturb(T_map_robot, covariance);
  }
  // Corrects the robot's error by an observation of an old keyframe, or of something first seen from it.
  // REQUIRES: Keep was called for that keyframe.
  template <int N>
  void Constrain(std::size_t keyframe, const Pose2& T_map_robot, const Innovation<N>& innovation);
  // Adds the error of resampling, in which the particles lost the share `lost` of their spread to common
  // parents.
  void Resample(double lost);
  // Appends the robot's error to the path. `spread_share` is the share of its variance over which the
  // particles still spread.
  void Keep(double spread_share) { path_.push_back(std::make_shared<Kept>(Kept{robot_, spread_share})); }
  // Sets the errors of all past keyframes to zero, and gives the robot's error this covariance of the pose,
  // (x, y, theta) in map.
  void Rebase(std::size_t keyframes, const Pose2& T_map_robot, const Eigen::Matrix3d& covariance);
  // The map was moved: what lies where keyframe k is, by T_new_old[k]. The errors stay as seen from the poses.
  void MoveMap(std::span<const Pose2> T_new_old);
  // Forgets the errors of keyframes.
  void Retire(const Retirement& retirement) {
    KeepOnly(path_, retirement);
    frozen_path_.Forget();
  }

  // The covariance of the robot's pose, (x, y, theta) in map.
  [[nodiscard]] Eigen::Matrix3d covariance(const Pose2& T_map_robot) const;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.rng_, self.robot_);
    InBlocks(archive, self.frozen_path_, self.path_);
    if constexpr (Archive::kReads) archive.Require(self.path_.size() == archive.keyframes(), "the errors of the path");
  }

 private:
  static constexpr int kMembers = 100;
  static constexpr int kHalf = kMembers / 2;
  using Errors = Eigen::Matrix<float, 3, kMembers>;
  struct Kept {
    Errors errors = Errors::Zero();
    double spread_share = 0.0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.errors, self.spread_share);
    }
  };

  // Derivative of a pose, (x, y, theta) in map, with respect to an error.
  static Eigen::Matrix3d J_pose_error(const Pose2& T_map_robot);
  template <typename Matrix>
  static auto Centred(const Matrix& columns) {
    return (columns.colwise() - columns.rowwise().mean()).eval();
  }
  // How an error changes with the frame in which it is given.
  static Eigen::Matrix3f J_new_old(const Pose2& T_new_old);
  void Disturb(const Pose2& T_map_robot, const Eigen::Matrix3d& covariance);
  void LoseAncestors(Errors& errors, double share, int partner) const;

  Rng rng_;
  Errors robot_ = Errors::Zero();
  // A checkpoint shares them, so that one with another owner is never changed.
  std::vector<std::shared_ptr<const Kept>> path_;
  FrozenBlocks<std::shared_ptr<const Kept>> frozen_path_;
};

template <int N>
void ErrorEnsemble::Constrain(std::size_t keyframe, const Pose2& T_map_robot, const Innovation<N>& innovation) {
  using Matrix = Eigen::Matrix<float, N, N>;
  const Eigen::Matrix<float, N, 3> J_z_error = (innovation.J_z_pose * J_pose_error(T_map_robot)).template cast<float>();
  const Matrix R = innovation.S_known_pose.template cast<float>();
  const Matrix root = R.llt().matrixL();
  const Errors since = robot_ - path_[keyframe]->errors;
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
