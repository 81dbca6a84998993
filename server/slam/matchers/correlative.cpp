#include "server/slam/matchers/correlative.h"

#include "server/slam/matchers/correlative_search.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/matching/point_to_line.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, CorrelativeOptions& options) {
  visitor.Real("window_m", options.window_m, "m", 0.05, 5.0,
               "Shifts of up to this are searched to either side of the prior.");
  visitor.Real("window_rad", options.window_rad, "rad", 0.01, kPi,
               "Turns of up to this are searched to either side of the prior.");
  visitor.Real("cell_m", options.cell_m, "m", 0.01, 0.5,
               "Step between two shifts. A smaller one is more accurate; the time grows with the square.");
  visitor.Real("turn_step_rad", options.turn_step_rad, "rad", 0.0005, 0.5, "Smallest step between two turns.");
  visitor.Integer("block", options.block, "cells", 2, 64,
                  "Side of a block of cells in the coarse search. A larger one excludes more at once, and less often.");
  visitor.Real("max_range_m", options.max_range_m, "m", 1.0, 50.0, "Points farther away are not used.");
  visitor.Integer("max_points", options.max_points, "1", 10, 10000,
                  "Most points of the scan that are used, evenly chosen.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.01, 1.0,
               "Standard deviation of the distance of a point from its surface.");
  visitor.Real("effective_points", options.effective_points, "1", 0.001, 1.0,
               "Share of the points that count as independent. A smaller value gives larger covariances.");
  visitor.Real("likely", options.likely, "1", 1.0, 100.0,
               "Motions whose log likelihood is at most this much below the best one count for the covariance.");
  visitor.Real("inlier_distance_m", options.inlier_distance_m, "m", 0.01, 1.0,
               "A point that is nearer to its surface counts as explained.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0,
               "Share of the points that must be explained. With fewer there is no match.");
  visitor.Require(options.cell_m <= options.window_m, "cell_m", "must not exceed", "window_m");
  visitor.Require(options.turn_step_rad <= options.window_rad, "turn_step_rad", "must not exceed", "window_rad");
}

MatchResult MatchByCorrelation(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                               const CorrelativeOptions& options, const ParallelFor& parallel_for) {
  MatchResult result;
  const auto fail = [&](MatchFailure failure) {
    result.T_ref_curr = prior.T_ref_curr;
    result.covariance = prior.covariance;
    result.failure = failure;
    return result;
  };
  if (ref.points_robot.size() < 5 || curr.points_robot.size() < 5) return fail(MatchFailure::kTooFewFeatures);
  const CorrelativeSearch search(ref.points_robot, curr.points_robot, prior, options);
  const CorrelativeSearch::Answer answer = search.Run(parallel_for);
  result.iterations = answer.tried;
  if (answer.on_border) return fail(MatchFailure::kNotConverged);

  const PointIndex reference(ref.points_robot);
  const SurfaceAgreement agreement =
      CompareSurfaces(curr.points_robot, reference, answer.mean, options.inlier_distance_m);
  result.score = agreement.score;
  result.inliers = agreement.inliers;
  if (result.score < options.min_score) return fail(MatchFailure::kInconsistent);
  result.T_ref_curr = answer.mean;
  result.covariance = 0.5 * (answer.covariance + answer.covariance.transpose());
  result.converged = true;
  DetectDegeneracy(agreement.H, result);
  TakeAlongFromPrior(prior, result);
  return result;
}

}  // namespace cairn::slam
