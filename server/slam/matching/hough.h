// Matches two scans in the Hough domain: correlating the spectra of directions gives the turn, correlating columns of
// the Hough transform gives the shift along several directions, and combinations of the peaks are hypotheses ranked by
// how well the points then lie on each other. Global: finds any turn and any shift within its window without a guess.
// The prior only bounds the search and decides between hypotheses the scans cannot tell apart. Not iterative, no
// refinement: about as exact as its bins. Needs walls; says nothing useful among trees.
// Frames: points in the robot frames of their scans; answers T_prev_curr. Stateless, thread-safe, deterministic; the
// hypotheses are worked on through `parallel_for`.
// Failures (the answer is the prior): kTooFewFeatures; kNoPairs, no hypothesis; kInconsistent, the best explains too
// little. Corridor: the place along it from the prior; converged and degenerate.
// Source: thesis B 2.2.1; Censi, Iocchi, Grisetti, ICRA 2005. Misprints put right: (2.7), (2.11), (2.14) have
// (cos - sin) T and (cos + sin) T for the projection (cos, sin) . T, (2.15) d(theta_1) for d(theta_i).
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"
#include "server/slam/match_result.h"
#include "server/slam/matching/match_prior.h"
#include "server/slam/matching/scan_view.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct HoughOptions {
  std::int64_t directions = 360;      // Of half a turn. More: finer turns, in proportionally more time.
  double rho_step_m = 0.05;           // Bin of the distance; smaller: finer shifts, needs denser points.
  double max_range_m = 20.0;          // Farther points are left out.
  double max_rotation_rad = kPi;      // Turns searched, about the prior's.
  double max_translation_m = 1.5;     // Shifts searched, about the prior's.
  std::int64_t turn_hypotheses = 5;   // Peaks of the spectra's correlation tried, each also half a turn on.
  std::int64_t shift_directions = 8;  // Directions whose columns are correlated ...
  std::int64_t shift_hypotheses = 3;  // ... and peaks taken of each.
  double inlier_distance_m = 0.12;    // A point nearer to a surface counts as explained.
  double prior_weight = 0.15;         // Of the explained share: what a hypothesis far from the prior loses at most.
  double min_score = 0.4;             // Fewer explained points: no answer.
  double degenerate_ratio = 0.02;     // Weakest over strongest hold on translation below which it is a corridor.
  double sigma_m = 0.03;              // Floor of the uncertainty: the bins' share.
  double sigma_rad = 0.006;
};
void Visit(OptionVisitor& visitor, HoughOptions& options);

[[nodiscard]] MatchResult MatchByHough(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                                       const HoughOptions& options, const ParallelFor& parallel_for);

}  // namespace cairn::slam
