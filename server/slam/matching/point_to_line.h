// Aligns a scan's surface points with a reference set by point-to-line ICP, starting from a guess whose uncertainty
// takes part as a prior: where the reference says nothing (along a corridor) the guess stays, everywhere else the scan
// decides. Not a global search: needs an initial error below about 0.5 m and 20 degrees.
// Reference points without a direction (rough or sparse surfaces) hold point to point with a fifth of the weight;
// without them the real logs come out ten times worse. Frames: points in `robot`, reference in `ref`; answers
// T_ref_robot. Stateless, thread-safe. Source: Censi, ICRA 2008 (metric); Cauchy weights; the prior makes it maximum a
// posteriori.
#pragma once

#include <span>

#include "common/options/option_visitor.h"
#include "server/slam/match_result.h"
#include "server/slam/matching/point_index.h"

namespace cairn::slam {

struct PointToLineOptions {
  std::int64_t max_iterations = 20;    // Hard bound; typical scans stop below 8.
  double first_pair_distance_m = 0.5;  // Larger tolerates worse guesses and accepts more wrong pairs.
  double last_pair_distance_m = 0.2;   // The gate shrinks to this over the iterations.
  double residual_sigma_m =
      0.04;                       // Of a point's distance to its surface; scales how the scan weighs against the prior.
  double effective_points = 1.0;  // Share of the points that count as independent; smaller: more cautious covariance.
  double stop_step_m = 5e-4;      // Stops when a step is smaller than both.
  double stop_step_rad = 2e-4;
  double inlier_distance_m = 0.12;  // A point nearer to its surface counts as explained.
  double min_score = 0.4;           // Fewer explained points: not converged.
  double degenerate_ratio = 0.02;   // Weakest over strongest constraint on translation below which it is a corridor.
};
void Visit(OptionVisitor& visitor, PointToLineOptions& options);

// Where to begin, and what is believed without the scan: usually the same pose.
struct AlignmentGuess {
  Pose2 T_ref_robot_start;
  Pose2 T_ref_robot_prior;
  Eigen::Matrix3d prior_covariance;  // Of (x, y, theta) of the prior, in `ref` axes.
};

// MatchResult::T_prev_curr holds T_ref_robot; the prior where nothing converged.
[[nodiscard]] MatchResult AlignPointsToSurfaces(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                                                const AlignmentGuess& guess, const PointToLineOptions& options);

}  // namespace cairn::slam
