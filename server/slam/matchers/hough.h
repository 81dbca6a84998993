// Matches two scans in the Hough domain. The correlation of the spectra over directions gives the turn, the
// correlation of columns of the Hough transform gives the shift along several directions. Combinations of the
// peaks are hypotheses, which are ranked by how well the points of the two scans then agree. Global: finds
// any turn and any shift within its window without a guess. The prior only bounds the search and decides
// between hypotheses that the scans cannot distinguish. Not iterative and without refinement, so about as
// exact as its bins. Needs walls; without straight surfaces the result is of no use.
// Frames: points in the robot frames of their scans; returns T_ref_curr. Stateless, thread-safe,
// deterministic; the hypotheses are distributed by `parallel_for`.
// Failures (the result is the prior): kTooFewFeatures; kNoPairs, no hypothesis; kInconsistent, the best
// hypothesis explains too little. In a corridor the position along it comes from the prior, and the result is
// converged and degenerate.
// Source: thesis B 2.2.1; Censi, Iocchi, Grisetti, ICRA 2005. Corrected: (2.7), (2.11), (2.14) have (cos -
// sin) T and (cos + sin) T for the projection (cos, sin) . T; (2.15) has d(theta_1) for d(theta_i).
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/scan_view.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct HoughOptions {
  std::int64_t directions = 360;
  double rho_step_m = 0.05;
  double max_range_m = 20.0;
  double max_rotation_rad = kPi;
  double max_translation_m = 1.5;
  std::int64_t turn_hypotheses = 5;
  std::int64_t shift_directions = 8;
  std::int64_t shift_hypotheses = 3;
  double inlier_distance_m = 0.12;
  double prior_weight = 0.15;
  double min_score = 0.4;
};
void Visit(OptionVisitor& visitor, HoughOptions& options);

[[nodiscard]] MatchResult MatchByHough(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                                       const HoughOptions& options, const ParallelFor& parallel_for);

}  // namespace cairn::slam
