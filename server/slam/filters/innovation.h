// The difference between a measurement and what a hypothesis expected, with what is needed to judge it and to learn
// from it. Small fixed sizes: inverses are closed forms.
// Source: thesis A Tables 4.5, 4.6, 4.8. Corrected: Table 4.8 prints the weight upside down, it is e^num / den.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "common/geometry/pose2.h"

namespace cairn::slam {

template <int N>
struct Innovation {
  Eigen::Matrix<double, N, 1> v;  // Measured minus expected, angles wrapped.
  Eigen::Matrix<double, N, 3> J_z_pose;
  Eigen::Matrix<double, N, N> S_known_pose;  // Covariance of v were the pose known: Sf.

  [[nodiscard]] Eigen::Matrix<double, N, N> S(const Eigen::Matrix3d& pose_covariance) const {
    return J_z_pose * pose_covariance * J_z_pose.transpose() + S_known_pose;
  }
};

// Squared Mahalanobis distance (normalised innovation squared).
template <int N>
[[nodiscard]] double Nis(const Eigen::Matrix<double, N, 1>& v, const Eigen::Matrix<double, N, N>& S) {
  return v.dot(S.inverse() * v);
}

// Log density of an innovation of covariance S at squared Mahalanobis distance `nis`.
template <int N>
[[nodiscard]] double LogDensity(double nis, const Eigen::Matrix<double, N, N>& S) {
  return -0.5 * (nis + std::log(std::max(S.determinant(), 1e-300)) + N * std::log(2.0 * kPi));
}

// Fuses one measurement into a pose (Table 4.6, one line of its loop) in Kalman form.
template <int N>
void CorrectPose(Pose2& pose, Eigen::Matrix3d& covariance, const Innovation<N>& innovation) {
  const Eigen::Matrix<double, 3, N> K =
      covariance * innovation.J_z_pose.transpose() * innovation.S(covariance).inverse();
  const Eigen::Vector3d step = K * innovation.v;
  pose = {pose.x + step.x(), pose.y + step.y(), WrapAngle(pose.theta + step.z())};
  const Eigen::Matrix3d P = (Eigen::Matrix3d::Identity() - K * innovation.J_z_pose) * covariance;
  covariance = 0.5 * (P + P.transpose());
}

// The innovation of a belief made of several: mean and covariance over all of them. A single particle's is no test of
// the filter, since what it has sampled is not in its own S.
template <int N>
class MixtureInnovation {
 public:
  void Add(double weight, const Eigen::Matrix<double, N, 1>& v, const Eigen::Matrix<double, N, N>& S) {
    sum_ += weight;
    mean_ += weight * v;
    second_ += weight * (S + v * v.transpose());
  }
  [[nodiscard]] bool empty() const { return !(sum_ > 0.0); }
  // REQUIRES: not empty.
  [[nodiscard]] double nis() const {
    const Eigen::Matrix<double, N, 1> v = mean_ / sum_;
    return Nis<N>(v, second_ / sum_ - v * v.transpose());
  }

 private:
  double sum_ = 0.0;
  Eigen::Matrix<double, N, 1> mean_ = Eigen::Matrix<double, N, 1>::Zero();
  Eigen::Matrix<double, N, N> second_ = Eigen::Matrix<double, N, N>::Zero();
};

}  // namespace cairn::slam
