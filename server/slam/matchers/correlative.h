// Matches two scans by evaluating every motion in a window: turns in steps of about a cell at the farthest
// point, shifts in steps of a cell. A coarse table bounds whole blocks of shifts, so that only promising
// blocks are evaluated cell by cell. The result is the mean over all likely motions and its covariance their
// spread, so that it shows corridors and second-best matches. The search is global within its window around
// the prior; the prior also weights the candidates.
// Frames: points in the robot frames of their scans; returns T_ref_curr. Stateless, thread-safe,
// deterministic: turns are distributed by `parallel_for`, and sums are of integers or in a fixed order.
// Failures (the result is the prior): kTooFewFeatures; kInconsistent, too few points explained;
// kNotConverged, the best motion lies on the window's border, so that a better one may lie outside.
// Source: Olson, "Real-Time Correlative Scan Matching", ICRA 2009: III.B (two levels), III.C (covariance, eq.
// 5).
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/scan_view.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct CorrelativeOptions {
  double window_m = 0.5;
  double window_rad = Radians(20.0);
  double cell_m = 0.03;
  double turn_step_rad = Radians(0.25);
  std::int64_t block = 8;
  double max_range_m = 15.0;
  std::int64_t max_points = 200;
  double sigma_m = 0.05;
  double effective_points = 0.1;
  double likely = 8.0;
  double inlier_distance_m = 0.12;
  double min_score = 0.4;
};
void Visit(OptionVisitor& visitor, CorrelativeOptions& options);

[[nodiscard]] MatchResult MatchByCorrelation(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                                             const CorrelativeOptions& options, const ParallelFor& parallel_for);

}  // namespace cairn::slam
