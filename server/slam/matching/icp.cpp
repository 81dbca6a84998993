#include "server/slam/matching/icp.h"

namespace cairn::slam {

MatchResult MatchByIcp(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                       const PointToLineOptions& options) {
  PointIndex reference(options.first_pair_distance_m);
  for (const SurfacePoint& point : prev.points_robot) reference.Add(point);
  return AlignPointsToSurfaces(curr.points_robot, reference, {prior.T_prev_curr, prior.T_prev_curr, prior.covariance},
                               options);
}

}  // namespace cairn::slam
