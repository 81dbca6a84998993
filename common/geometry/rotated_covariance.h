// The covariance of a pose (x, y, theta) in a frame that is turned. Stateless, thread-safe.
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"

namespace cairn {

// `covariance` is that of (x, y, theta) in frame b; the result is that in frame a, for which b is turned by
// `theta_a_b` (rad). From frame a into frame b the angle is -theta_a_b.
template <typename Scalar>
[[nodiscard]] Eigen::Matrix<Scalar, 3, 3> Rotated(const Eigen::Matrix<Scalar, 3, 3>& covariance, double theta_a_b) {
  Eigen::Matrix<Scalar, 3, 3> R_a_b = Eigen::Matrix<Scalar, 3, 3>::Identity();
  R_a_b.template topLeftCorner<2, 2>() = Pose2{0.0, 0.0, theta_a_b}.rotation().template cast<Scalar>();
  return R_a_b * covariance * R_a_b.transpose();
}

}  // namespace cairn
