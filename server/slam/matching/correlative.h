// Matches two scans by trying every motion in a window: turns in steps of about a cell at the farthest point, shifts in
// steps of a cell; a coarse table bounds whole blocks of shifts, so that only promising ones are tried cell by cell.
// The answer is the mean over all likely motions, its covariance their spread: corridors and second-best answers show
// in it. Global within its window, which is all it needs of the prior; the prior also weighs the candidates. Frames:
// points in the robot frames of their scans; answers T_prev_curr. Stateless, thread-safe, deterministic: turns are
// worked on through `parallel_for`, sums are of integers or in fixed order. Failures (the answer is the prior):
// kTooFewFeatures; kInconsistent, too few points explained; kNotConverged, the best motion lies on the window's border,
// so a better one may lie outside. Source: Olson, "Real-Time Correlative Scan Matching", ICRA 2009: III.B (two levels),
// III.C (covariance, eq. 5).
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"
#include "server/slam/match_result.h"
#include "server/slam/matching/match_prior.h"
#include "server/slam/matching/scan_view.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct CorrelativeOptions {
  double window_m = 0.5;                 // Shifts searched either way, in x and in y, about the prior's.
  double window_rad = Radians(20.0);     // Turns searched either way.
  double cell_m = 0.03;                  // Step of the shifts; smaller: finer, slower with the square.
  double turn_step_rad = Radians(0.25);  // Least step of the turns; farther points call for finer ones in vain.
  std::int64_t block = 8;                // Cells of a coarse block: larger prunes more at once, but less sharply.
  double max_range_m = 15.0;             // Farther points are left out.
  std::int64_t max_points = 200;         // Of the current scan, evenly picked.
  double sigma_m = 0.05;                 // Of a point's distance to its surface.
  double effective_points = 0.1;         // Share of the points that count as independent: wide peaks, cautious answers.
  double likely = 8.0;                   // Motions this much less likely (natural logarithm) than the best count.
  double inlier_distance_m = 0.12;       // A point nearer to a surface counts as explained.
  double min_score = 0.4;                // Fewer explained points: no answer.
  double degenerate_ratio = 0.02;        // Weakest over strongest hold on translation below which it is a corridor.
};
void Visit(OptionVisitor& visitor, CorrelativeOptions& options);

[[nodiscard]] MatchResult MatchByCorrelation(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                                             const CorrelativeOptions& options, const ParallelFor& parallel_for);

}  // namespace cairn::slam
