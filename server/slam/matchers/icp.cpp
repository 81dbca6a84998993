#include "server/slam/matchers/icp.h"

#include "server/slam/matching/match_result.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/matching/point_to_line.h"

namespace cairn::slam {

MatchResult MatchByIcp(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                       const PointToLineOptions& options) {
  const PointIndex reference(ref.points_robot);
  MatchResult result = AlignPointsToSurfaces(curr.points_robot, reference,
                                             {prior.T_ref_curr, prior.T_ref_curr, prior.covariance}, options);
  if (!result.converged) return result;
  // Points without a surface direction, as at the far ends of a corridor, must not hide that the scan shows a
  // corridor.
  const SurfaceAgreement agreement =
      CompareSurfaces(curr.points_robot, reference, result.T_ref_curr, options.inlier_distance_m);
  DetectDegeneracy(agreement.H, result);
  TakeAlongFromPrior(prior, result);
  return result;
}

}  // namespace cairn::slam
