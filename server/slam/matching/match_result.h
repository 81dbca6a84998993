// The result of every scan matcher: the motion of the robot between two scans, its uncertainty, and the
// reason if there is no match.
// T_ref_curr maps coordinates in the robot frame of the current scan to the robot frame of the reference
// scan.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "common/geometry/pose2.h"

namespace cairn::slam {

enum class MatchFailure : std::uint8_t { kNone = 0, kTooFewFeatures, kNoPairs, kInconsistent, kNotConverged, kFault };

struct MatchResult {
  Pose2 T_ref_curr;
  // Covariance of (x, y, theta) of T_ref_curr, in ref.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  double score = 0.0;  // 0..1: share of the current scan's points or lines that agree with the result.
  int inliers = 0;     // Number of pairs (of lines or points) that support the result.
  int iterations = 0;
  bool converged = false;   // The pose is usable.
  bool degenerate = false;  // One direction of the plane is not constrained (corridor).
  Eigen::Vector2d degenerate_direction = Eigen::Vector2d::Zero();  // That direction: a unit vector, in ref.
  MatchFailure failure = MatchFailure::kNone;
};

}  // namespace cairn::slam
