// Poses as three numbers: how two poses of one frame differ in (x, y, theta), and a pose changed by such a difference.
// This is the difference that innovations, priors and small corrections are made of. It is no motion: a motion is
// given in the frame of the robot (Between, operator*). Angles are wrapped. Stateless, thread-safe.
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"

namespace cairn {

[[nodiscard]] inline Eigen::Vector3d Minus(const Pose2& a, const Pose2& b) {
  Eigen::Vector3d difference = a.vector() - b.vector();
  difference.z() = WrapAngle(difference.z());
  return difference;
}

// Plus(b, Minus(a, b)) is a.
[[nodiscard]] inline Pose2 Plus(const Pose2& pose, const Eigen::Vector3d& difference) {
  return {pose.x + difference.x(), pose.y + difference.y(), WrapAngle(pose.theta + difference.z())};
}

}  // namespace cairn
