// The evidence of an NDT for a pose of a scan: how many points it explains, the covariance of the pose, and
// whether one direction is left open, fused with the prior. Used by both searches, ndt and ndt_de.
// Frames: map = `ref`, points = `curr`; the result is T_ref_curr. Stateless, thread-safe.
// Source: information from the Hessian as in Biber and Strasser 2003 and Stoyanov 2009; the fusion with the
// prior is Bayes' rule for normal distributions.
#pragma once

#include <span>

#include "server/slam/matchers/ndt_map.h"
#include "server/slam/matching/match_result.h"

namespace cairn::slam {

struct NdtEvidenceOptions {
  double min_score = 0.5;
  std::int64_t min_inliers = 8;
  double information_share = 0.5;  // See InformationOf.
};
void Visit(OptionVisitor& visitor, NdtEvidenceOptions& options);

// Information about the pose: the negative Hessian of the score without its negative part. A point counts in
// up to four grids, but points far from the means count less than their information. With a share of 0.75 the
// errors of simulated scans agree with the covariance (ndt_test); the default is lower and so more careful.
[[nodiscard]] Eigen::Matrix3d InformationOf(const NdtDerivatives& at_pose, const NdtEvidenceOptions& options);

// The result for pose T_ref_curr. `settled`: the search itself converged. If the evidence is too weak the
// result is the prior, not converged. In a direction that the scan leaves open the prior decides.
[[nodiscard]] MatchResult EvaluateNdtPose(const NdtMap& map, std::span<const Eigen::Vector2d> points_curr,
                                          const Pose2& T_ref_curr, bool settled, const MatchPrior& prior,
                                          const NdtEvidenceOptions& options);

// The prior as a result that did not converge, with the reason.
[[nodiscard]] MatchResult UnmatchedNdt(const MatchPrior& prior, MatchFailure failure);

}  // namespace cairn::slam
