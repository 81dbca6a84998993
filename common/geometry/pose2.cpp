#include "common/geometry/pose2.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace cairn {

Eigen::Matrix2d Pose2::rotation() const {
  const double c = std::cos(theta), s = std::sin(theta);
  Eigen::Matrix2d R;
  R << c, -s, s, c;
  return R;
}

Pose2 Pose2::Inverse() const {
  const double c = std::cos(theta), s = std::sin(theta);
  return {-c * x - s * y, s * x - c * y, WrapAngle(-theta)};
}

bool Pose2::IsFinite() const {
  return std::isfinite(x) && std::isfinite(y) && std::isfinite(theta);
}

Eigen::Vector2d Pose2::operator*(const Eigen::Vector2d& p_b) const {
  const double c = std::cos(theta), s = std::sin(theta);
  return {x + c * p_b.x() - s * p_b.y(), y + s * p_b.x() + c * p_b.y()};
}

Pose2 Pose2::operator*(const Pose2& T_b_c) const {
  const double c = std::cos(theta), s = std::sin(theta);
  return {x + c * T_b_c.x - s * T_b_c.y, y + s * T_b_c.x + c * T_b_c.y, WrapAngle(theta + T_b_c.theta)};
}

Pose2 Between(const Pose2& T_a_b, const Pose2& T_a_c) {
  const double c = std::cos(T_a_b.theta), s = std::sin(T_a_b.theta);
  const double dx = T_a_c.x - T_a_b.x, dy = T_a_c.y - T_a_b.y;
  return {c * dx + s * dy, -s * dx + c * dy, AngleDiff(T_a_c.theta, T_a_b.theta)};
}

Pose2 Interpolate(const Pose2& from, const Pose2& to, double fraction) {
  return {from.x + fraction * (to.x - from.x), from.y + fraction * (to.y - from.y),
          WrapAngle(from.theta + fraction * AngleDiff(to.theta, from.theta))};
}

Eigen::Matrix3d J_compose_left(const Pose2& T_a_b, const Pose2& T_b_c) {
  const double c = std::cos(T_a_b.theta), s = std::sin(T_a_b.theta);
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J(0, 2) = -s * T_b_c.x - c * T_b_c.y;
  J(1, 2) = c * T_b_c.x - s * T_b_c.y;
  return J;
}

Eigen::Matrix3d J_compose_right(const Pose2& T_a_b, const Pose2& /*T_b_c*/) {
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.topLeftCorner<2, 2>() = T_a_b.rotation();
  return J;
}

Eigen::Matrix3d J_inverse(const Pose2& T_a_b) {
  const double c = std::cos(T_a_b.theta), s = std::sin(T_a_b.theta);
  Eigen::Matrix3d J;
  J << -c, -s, s * T_a_b.x - c * T_a_b.y, s, -c, c * T_a_b.x + s * T_a_b.y, 0, 0, -1;
  return J;
}

Eigen::Matrix3d PoseCovariance(double sigma_m, double sigma_rad) {
  return Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
}

bool IsCovariance(const Eigen::Matrix3d& matrix, double tolerance) {
  if (!matrix.allFinite()) return false;
  const double scale = std::max(1e-300, matrix.cwiseAbs().maxCoeff());
  if ((matrix - matrix.transpose()).cwiseAbs().maxCoeff() > tolerance * scale) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(matrix, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().minCoeff() >= -tolerance * scale;
}

}  // namespace cairn
