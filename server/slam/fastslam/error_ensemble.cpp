#include "server/slam/fastslam/error_ensemble.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

// Resampling does not change keyframes whose particles spread over less than this share of the variance.
constexpr double kNothingLeft = 0.02;

}  // namespace

Eigen::Matrix3d ErrorEnsemble::J_pose_error(const Pose2& T_map_robot) {
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J(0, 2) = -T_map_robot.y;
  J(1, 2) = T_map_robot.x;
  return J;
}

void ErrorEnsemble::Disturb(const Pose2& T_map_robot, const Eigen::Matrix3d& covariance) {
  // The covariance may be singular: a direction may be without noise.
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(covariance);
  Eigen::Matrix3d root = ldlt.matrixL();
  root = ldlt.transpositionsP().transpose() * root;
  root = (root * ldlt.vectorD().cwiseMax(0.0).cwiseSqrt().asDiagonal()).eval();
  const Eigen::Matrix3f errors_of = (J_pose_error(T_map_robot).inverse() * root).cast<float>();
  for (int j = 0; j < kMembers; ++j) {
    const Eigen::Vector3d draw = ThreeNormalDraws(rng_);
    robot_.col(j) += errors_of * draw.cast<float>();
  }
}

void ErrorEnsemble::Move(const Pose2& T_map_prev, const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev) {
  const Eigen::Matrix3d J = J_compose_right(T_map_prev, T_prev_curr);
  Disturb(T_map_prev * T_prev_curr, J * covariance_prev * J.transpose());
}

void ErrorEnsemble::MoveBySampling(const Pose2& T_map_prev, const StepMotion& step, const MotionSampler& sampler) {
  const Pose2 T_map_curr = T_map_prev * step.T_prev_curr;
  const Eigen::Matrix3d J_error_pose = J_pose_error(T_map_curr).inverse();
  for (int j = 0; j < kMembers; ++j) {
    const Eigen::Vector3d d = Minus(sampler.draw(T_map_prev, step, rng_), T_map_curr);
    robot_.col(j) += (J_error_pose * d).cast<float>();
  }
}

void ErrorEnsemble::Resample(double lost) {
  const int partner = 1 + static_cast<int>(UniformDraw(rng_) * (kMembers - 1));
  const double robot_share = path_.empty() ? 0.0 : path_.back()->spread_share;
  LoseAncestors(robot_, lost * robot_share, partner);
  auto at = path_.rbegin();
  for (; at != path_.rend() && (*at)->spread_share > kNothingLeft; ++at) {
    // Only a checkpoint, which may be written on another thread, shares it, and must not see the change. Holding it
    // once more puts what that thread has read before the change (as in shared_sequence.h).
    const bool shared = at->use_count() > 1;
    auto kept = shared ? std::make_shared<Kept>(**at) : std::const_pointer_cast<Kept>(*at);
    LoseAncestors(kept->errors, lost * kept->spread_share, partner);
    kept->spread_share *= 1.0 - lost;
    *at = std::move(kept);
  }
  frozen_path_.ForgetFrom(static_cast<std::size_t>(at.base() - path_.begin()));
}

// Resampling moves the mean of the particles to that of the ancestors that are left, which are a random draw
// from the spread of the set. Each member gets such a draw: the scaled deviation of another member. The
// partner is the same for every pose, because a path is inherited as a whole.
void ErrorEnsemble::LoseAncestors(Errors& errors, double share, int partner) const {
  const auto scale = static_cast<float>(std::sqrt(share));
  const Errors drawn = scale * Centred(errors);
  errors.leftCols(kMembers - partner) += drawn.rightCols(kMembers - partner);
  errors.rightCols(partner) += drawn.leftCols(partner);
}

void ErrorEnsemble::Rebase(std::size_t keyframes, const Pose2& T_map_robot, const Eigen::Matrix3d& covariance) {
  path_.assign(keyframes, std::make_shared<Kept>());
  frozen_path_.Forget();
  Begin(T_map_robot, covariance);
}

// The adjoint of the motion, because Exp(error_new) = T_new_old * Exp(error_old) * T_new_old^-1.
Eigen::Matrix3f ErrorEnsemble::J_new_old(const Pose2& T_new_old) {
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.topLeftCorner<2, 2>() = T_new_old.rotation();
  J(0, 2) = T_new_old.y;
  J(1, 2) = -T_new_old.x;
  return J.cast<float>();
}

void ErrorEnsemble::MoveMap(std::span<const Pose2> T_new_old) {
  std::size_t unmoved = path_.size();
  for (std::size_t k = 0; k < path_.size(); ++k) {
    if (T_new_old[k] == Pose2{}) continue;
    unmoved = std::min(unmoved, k);
    path_[k] = std::make_shared<Kept>(Kept{J_new_old(T_new_old[k]) * path_[k]->errors, path_[k]->spread_share});
  }
  frozen_path_.ForgetFrom(unmoved);
  robot_ = J_new_old(T_new_old.back()) * robot_;
}

Eigen::Matrix3d ErrorEnsemble::covariance(const Pose2& T_map_robot) const {
  const auto centred = Centred(robot_);
  const Eigen::Matrix3d errors = (centred * centred.transpose()).cast<double>() / (kMembers - 1.0);
  const Eigen::Matrix3d J = J_pose_error(T_map_robot);
  return J * errors * J.transpose();
}

}  // namespace cairn::slam
