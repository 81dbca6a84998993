// The result of every scan matcher: the motion of the robot between two scans, its uncertainty, and the
// reason if there is no match. Also what follows if the scans leave one direction of the plane free (a
// corridor, a single wall). Plain values and functions without state.
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
  // Information of the surfaces on the position along it, 1/m^2; 0 if the position comes from the prior alone.
  double open_information = 0.0;
  // Information of the surfaces on the translation, in ref and 1/m^2, with the heading left free. Zero where the result
  // does not come from the alignment with surfaces.
  Eigen::Matrix2d surface_information = Eigen::Matrix2d::Zero();
  // The covariance with the noise that the points themselves show, in place of `residual_sigma_m` for every lidar.
  // It is the noise of the answer for one scan. Zero where the result does not come from the alignment with surfaces.
  Eigen::Matrix3d shown_covariance = Eigen::Matrix3d::Zero();
  MatchFailure failure = MatchFailure::kNone;
};

// The estimate of the motion between two scans before they are matched, from odometry or a forecast.
struct MatchPrior {
  Pose2 T_ref_curr;                                          // Start of a matcher; the identity if unknown.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Covariance of (x, y, theta), in ref.
};

// Sets `degenerate` and `degenerate_direction`. H is the information on (x, y, theta). The match is
// degenerate if, with the heading left free, the smallest eigenvalue of the information on the translation is
// below 0.02 times the largest. The direction is the eigenvector of the smallest. `open_information` is that
// eigenvalue, without the part that errors in the directions of the surfaces would show along a bare wall; it is 1/m^2
// only if H is. Towards the bound it grows beyond all measure, because a match that is not degenerate decides alone.
void DetectDegeneracy(const Eigen::Matrix3d& H, MatchResult& result);

// Combines two translations: across `along` the result is `measured`, along it `prior`. Both are in one
// frame; `along` is a unit vector.
[[nodiscard]] Eigen::Vector2d TakeAlongFromPrior(const Eigen::Vector2d& measured, const Eigen::Vector2d& prior,
                                                 const Eigen::Vector2d& along);

// The same for a whole result, if it is degenerate: position and uncertainty along the degenerate direction
// are replaced by those of the prior. Apparent evidence along a corridor is only the end of the view, which
// moves with the robot.
void TakeAlongFromPrior(const MatchPrior& prior, MatchResult& result);

// If the result is degenerate: takes the position along the degenerate direction, and its uncertainty, from the prior
// and from what surfaces show of it (`open_information`), each according to its certainty.
void WeighAlongWithPrior(const MatchPrior& prior, MatchResult& result);

// How far WeighAlongWithPrior moves the position along the open direction from the prior, which has this variance,
// towards the one that the surfaces show: 0 stays at the prior.
[[nodiscard]] inline double GainAlong(double prior_variance, double open_information) {
  const double ratio = prior_variance * open_information;
  return ratio / (1.0 + ratio);
}

}  // namespace cairn::slam
