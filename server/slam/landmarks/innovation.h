// The innovation of a measurement, which is its difference from the value that a hypothesis predicts, with
// the matrices that weighting and updating need. The sizes are small and fixed, so inverses have closed
// forms.
// Source: thesis A Tables 4.5, 4.6, 4.8. Corrected: Table 4.8 prints the weight upside down; correct is e^num
// / den.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "common/geometry/pose2.h"
#include "common/geometry/pose_difference.h"

namespace cairn::slam {

template <int N>
struct Innovation {
  Eigen::Matrix<double, N, 1> v;  // Measured minus expected, angles wrapped.
  Eigen::Matrix<double, N, 3> J_z_pose;
  Eigen::Matrix<double, N, N> S_known_pose;  // Covariance of v if the pose were known exactly: Sf.

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
  pose = Plus(pose, K * innovation.v);
  const Eigen::Matrix3d P = (Eigen::Matrix3d::Identity() - K * innovation.J_z_pose) * covariance;
  covariance = 0.5 * (P + P.transpose());
}

// The innovation of a mixture of hypotheses, from the mean and the covariance over all of them. The
// innovation of a single particle does not test the filter, because what was sampled is not part of the
// particle's S.
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

// Quantile of the chi-square distribution, which bounds a squared Mahalanobis distance or a sum of them: the x with P(X
// <= x) = share, for `numbers` degrees of freedom. REQUIRES: 0 < share < 1, numbers > 0.
[[nodiscard]] double ChiSquareQuantile(double share, double numbers);

// P(X <= x): the regularised lower incomplete gamma function of numbers / 2 and x / 2.
[[nodiscard]] double ChiSquareShare(double x, double numbers);

}  // namespace cairn::slam
