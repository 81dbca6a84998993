// A rigid motion of the plane, SE(2). `T_a_b` maps coordinates of frame b into frame a, so in a product the inner
// names touch: T_map_laser = T_map_robot * T_robot_laser. Metres and radians; theta is wrapped to (-pi, pi].
// Not a Lie-group library: tangent vectors here are plain (dx, dy, dtheta) in the frame named by the function.
#pragma once

#include <Eigen/Core>

#include "common/geometry/angle.h"

namespace cairn {

struct Pose2 {
  double x = 0.0;
  double y = 0.0;
  double theta = 0.0;

  [[nodiscard]] Eigen::Vector2d translation() const { return {x, y}; }
  [[nodiscard]] Eigen::Vector3d vector() const { return {x, y, theta}; }
  [[nodiscard]] Eigen::Matrix2d rotation() const;
  [[nodiscard]] Pose2 Inverse() const;
  [[nodiscard]] bool IsFinite() const;

  // Coordinates of a point of frame b in frame a.
  [[nodiscard]] Eigen::Vector2d operator*(const Eigen::Vector2d& p_b) const;
  [[nodiscard]] Pose2 operator*(const Pose2& T_b_c) const;
  bool operator==(const Pose2&) const = default;
};

// T_a_b^-1 * T_a_c: frame c seen from frame b.
[[nodiscard]] Pose2 Between(const Pose2& T_a_b, const Pose2& T_a_c);

// The pose a fraction of the way from one to the other: position along the chord, heading along the shorter arc.
[[nodiscard]] Pose2 Interpolate(const Pose2& from, const Pose2& to, double fraction);

// d(T_a_b * T_b_c) / d(T_a_b) and / d(T_b_c), in (x, y, theta) of each.
[[nodiscard]] Eigen::Matrix3d J_compose_left(const Pose2& T_a_b, const Pose2& T_b_c);
[[nodiscard]] Eigen::Matrix3d J_compose_right(const Pose2& T_a_b, const Pose2& T_b_c);

// d(T^-1) / d(T).
[[nodiscard]] Eigen::Matrix3d J_inverse(const Pose2& T_a_b);

// The covariance of (x, y, theta) with these standard deviations of x and of y, and of theta, without correlation.
[[nodiscard]] Eigen::Matrix3d PoseCovariance(double sigma_m, double sigma_rad);

// True if the matrix is finite, symmetric within `tolerance` of its scale, and positive semi-definite.
[[nodiscard]] bool IsCovariance(const Eigen::Matrix3d& matrix, double tolerance = 1e-9);

}  // namespace cairn
