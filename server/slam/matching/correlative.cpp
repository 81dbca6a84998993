#include "server/slam/matching/correlative.h"

#include "server/slam/matching/correlative_search.h"
#include "server/slam/matching/degeneracy.h"
#include "server/slam/matching/surface_agreement.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, CorrelativeOptions& options) {
  visitor.Real("window_m", options.window_m, "m", 0.05, 5.0, "Shifts searched either way about the prior's.");
  visitor.Real("window_rad", options.window_rad, "rad", 0.01, kPi, "Turns searched either way.");
  visitor.Real("cell_m", options.cell_m, "m", 0.01, 0.5, "Step of the shifts; smaller: finer, slower by its square.");
  visitor.Real("turn_step_rad", options.turn_step_rad, "rad", 0.0005, 0.5, "Least step of the turns.");
  visitor.Integer("block", options.block, "cells", 2, 64, "Of a coarse block; larger prunes more, less sharply.");
  visitor.Real("max_range_m", options.max_range_m, "m", 1.0, 50.0, "Farther points are left out.");
  visitor.Integer("max_points", options.max_points, "1", 10, 10000, "Of the current scan, evenly picked.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.01, 1.0, "Of a point's distance to its surface.");
  visitor.Real("effective_points", options.effective_points, "1", 0.001, 1.0,
               "Share of points that count as independent; smaller: more cautious.");
  visitor.Real("likely", options.likely, "1", 1.0, 100.0, "Motions this much less likely (log) than the best count.");
  visitor.Real("inlier_distance_m", options.inlier_distance_m, "m", 0.01, 1.0, "A nearer point counts as explained.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0, "Fewer explained points: no answer.");
  visitor.Real("degenerate_ratio", options.degenerate_ratio, "1", 0.0, 1.0,
               "Weakest over strongest hold on translation below which it is a corridor.");
}

MatchResult MatchByCorrelation(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                               const CorrelativeOptions& options, const ParallelFor& parallel_for) {
  MatchResult result;
  const auto fail = [&](MatchFailure failure) {
    result.T_prev_curr = prior.T_prev_curr;
    result.covariance = prior.covariance;
    result.failure = failure;
    return result;
  };
  if (prev.points_robot.size() < 5 || curr.points_robot.size() < 5) return fail(MatchFailure::kTooFewFeatures);
  const CorrelativeSearch search(prev.points_robot, curr.points_robot, prior, options);
  const CorrelativeSearch::Answer answer = search.Run(parallel_for);
  result.iterations = answer.tried;
  if (answer.on_border) return fail(MatchFailure::kNotConverged);

  PointIndex reference(options.inlier_distance_m);
  for (const SurfacePoint& point : prev.points_robot) reference.Add(point);
  const SurfaceAgreement agreement =
      CompareSurfaces(curr.points_robot, reference, answer.mean, options.inlier_distance_m);
  result.score = agreement.score;
  result.inliers = agreement.inliers;
  if (result.score < options.min_score) return fail(MatchFailure::kInconsistent);
  result.T_prev_curr = answer.mean;
  result.covariance = 0.5 * (answer.covariance + answer.covariance.transpose());
  result.converged = true;
  JudgeDegeneracy(agreement.H, options.degenerate_ratio, result);
  TakeAlongFromPrior(prior, result);
  return result;
}

}  // namespace cairn::slam
