// What an NDT says for a pose at which a scan was laid on it: how many points it explains, how sure the pose is, and
// whether one direction is left open; joined with what was believed before. Common to both ways of finding the pose.
// Frames: map = `prev`, points = `curr`; the answer is T_prev_curr. Stateless, thread-safe.
// Source: information from the Hessian as in Biber and Strasser 2003 / Stoyanov 2009; the join with the prior is
// Bayes' rule for normal distributions.
#pragma once

#include <span>

#include "server/slam/match_result.h"
#include "server/slam/matching/match_prior.h"
#include "server/slam/matching/ndt_map.h"

namespace cairn::slam {

struct NdtEvidenceOptions {
  double min_score = 0.5;          // Fewer explained points: not converged.
  std::int64_t min_inliers = 8;    // Nor with fewer explained points than this.
  double information_share = 0.5;  // Of the Hessian that counts; smaller: more cautious. See InformationOf.
  double degenerate_ratio = 0.03;  // Weakest over strongest hold on translation below which it is a corridor.
  double open_sigma_m = 0.05;      // At least, along the open direction. Measured on duke-loop5: 0.045 m a scan.
};
void Visit(OptionVisitor& visitor, NdtEvidenceOptions& options);

// Information about the pose: the negative Hessian of the score without its negative part. A point counts in up to four
// grids, but those far from their means for less than their information: with a share of 0.75 the errors of simulated
// scans are as large as the covariance says (ndt_test); the default leaves some room.
[[nodiscard]] Eigen::Matrix3d InformationOf(const NdtDerivatives& at_pose, const NdtEvidenceOptions& options);

// The answer for pose T. `settled`: the search itself ended well. Where the evidence is too thin the answer is the
// prior, not converged. Where the scan leaves a direction open the prior decides along it.
[[nodiscard]] MatchResult JudgeNdtPose(const NdtMap& map, std::span<const Eigen::Vector2d> points_curr,
                                       const Pose2& T_prev_curr, bool settled, const MatchPrior& prior,
                                       const NdtEvidenceOptions& options);

// The prior as an answer that did not converge, and why.
[[nodiscard]] MatchResult UnmatchedNdt(const MatchPrior& prior, MatchFailure failure);

}  // namespace cairn::slam
