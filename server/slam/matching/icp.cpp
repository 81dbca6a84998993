#include "server/slam/matching/icp.h"

#include "server/slam/matching/degeneracy.h"
#include "server/slam/matching/surface_agreement.h"

namespace cairn::slam {

MatchResult MatchByIcp(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                       const PointToLineOptions& options) {
  PointIndex reference(options.first_pair_distance_m);
  for (const SurfacePoint& point : prev.points_robot) reference.Add(point);
  MatchResult result = AlignPointsToSurfaces(curr.points_robot, reference,
                                             {prior.T_prev_curr, prior.T_prev_curr, prior.covariance}, options);
  if (!result.converged) return result;
  // Points without a surface direction, as at the far ends of a corridor, must not hide that it is one.
  const SurfaceAgreement agreement =
      CompareSurfaces(curr.points_robot, reference, result.T_prev_curr, options.inlier_distance_m);
  JudgeDegeneracy(agreement.H, options.degenerate_ratio, result);
  TakeAlongFromPrior(prior, result);
  return result;
}

}  // namespace cairn::slam
