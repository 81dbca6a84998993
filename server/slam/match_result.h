// What every scan matcher answers: how the robot moved between two scans, how sure that is, and why not.
// T_prev_curr maps coordinates of the robot at the current scan into the robot's frame at the previous one.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string_view>

#include "common/geometry/pose2.h"

namespace cairn::slam {

enum class MatchFailure : std::uint8_t { kNone = 0, kTooFewFeatures, kNoPairs, kInconsistent, kNotConverged, kFault };
[[nodiscard]] std::string_view MatchFailureName(MatchFailure failure);

struct MatchResult {
  Pose2 T_prev_curr;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Of (x, y, theta) of T_prev_curr, in prev.
  double score = 0.0;  // 0..1: share of the current scan's evidence that agrees with the answer.
  int inliers = 0;     // Pairs (lines or points) behind the answer.
  int iterations = 0;
  bool converged = false;   // The pose is usable.
  bool degenerate = false;  // One direction of the plane is not constrained (corridor) ...
  Eigen::Vector2d degenerate_direction = Eigen::Vector2d::Zero();  // ... this unit vector, in prev.
  MatchFailure failure = MatchFailure::kNone;
};

}  // namespace cairn::slam
