// The Kalman filter of one pose that LineMatch feeds: a hypothesis from the map corrects what the steps led to (2.17:
// motion/dead_reckoning.h). Starting from Unknown(), the first hypothesis is the belief. Frames: T_map_robot. Plain
// values, thread-safe. Source: thesis B 2.2.2, (2.18), (2.19). Put right: the third row of (2.17) adds the turn, not
// the distance; (2.18) fuses the predicted covariance in both lines; headings are fused as differences, wrapped.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "common/geometry/pose2.h"
#include "server/slam/matching/line_match.h"

namespace cairn::slam {

struct PoseBelief {
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Of (x, y, theta) in map.

  // (2.19), with 10^4 m and 10^2 rad for infinity.
  [[nodiscard]] static PoseBelief Unknown();
};

// Squared Mahalanobis distance of a hypothesis from the belief.
[[nodiscard]] double DistanceOf(const PoseBelief& belief, const LineMatchHypothesis& hypothesis);

// Index of the hypothesis nearest to the belief; nothing where even that is beyond `gate` (chi-square, 3 degrees of
// freedom).
[[nodiscard]] std::optional<std::size_t> Nearest(const PoseBelief& belief,
                                                 std::span<const LineMatchHypothesis> hypotheses, double gate = 16.3);

// (2.18)
[[nodiscard]] PoseBelief Fuse(const PoseBelief& belief, const LineMatchHypothesis& hypothesis);

}  // namespace cairn::slam
