// The Kalman filter of one pose for LineMatch: a hypothesis from the map corrects the prediction (2.17),
// which is in motion/dead_reckoning.h. If the belief is Unknown(), the first hypothesis becomes the belief.
// Frames: T_map_robot. Plain values, thread-safe.
// Source: thesis B 2.2.2, (2.18), (2.19). Corrected: the third row of (2.17) adds the turn, not the distance;
// (2.18) fuses the predicted covariance in both lines; headings are fused as wrapped differences.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "common/geometry/pose2.h"
#include "server/slam/localisation/line_match.h"

namespace cairn::slam {

struct PoseBelief {
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Covariance of (x, y, theta) in `map`.

  // The unknown pose (2.19), with 10^4 m and 10^2 rad for infinity.
  [[nodiscard]] static PoseBelief Unknown();

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_map_robot, self.covariance);
  }
};

// Squared Mahalanobis distance of a hypothesis from the belief.
[[nodiscard]] double DistanceOf(const PoseBelief& belief, const LineMatchHypothesis& hypothesis);

// Index of the hypothesis nearest to the belief, or nothing if its distance is above `gate` (chi-square, 3
// degrees of freedom).
[[nodiscard]] std::optional<std::size_t> Nearest(const PoseBelief& belief,
                                                 std::span<const LineMatchHypothesis> hypotheses, double gate = 16.3);

// Fuses the belief with a hypothesis, (2.18).
[[nodiscard]] PoseBelief Fuse(const PoseBelief& belief, const LineMatchHypothesis& hypothesis);

}  // namespace cairn::slam
