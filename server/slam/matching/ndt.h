// Scan matching by the normal distributions transform: lays the points of one scan where the distributions of the other
// are densest, by Newton's algorithm with the exact gradient and Hessian. No correspondences, no features.
// Not a global search: needs an initial error below about half a cell and 15 degrees (ndt_de searches).
// Frames: both scans in their robot frames; answers T_prev_curr. Stateless, thread-safe.
// Source: Biber and Strasser, IROS 2003; thesis C 2.3.3 (2.14)-(2.19).
#pragma once

#include "server/slam/matching/ndt_evidence.h"
#include "server/slam/matching/scan_view.h"
#include "server/slam/parallel_for.h"
#include "server/slam/scan/thinning.h"

namespace cairn::slam {

struct NewtonOptions {
  std::int64_t max_iterations = 40;  // Hard bound; typical scans stop below 12.
  double longest_step_m = 0.3;       // A step longer than either is shortened.
  double longest_step_rad = 0.15;
  double stop_step_m = 5e-5;  // Stops when a step is smaller than both.
  double stop_step_rad = 2e-5;
};
void Visit(OptionVisitor& visitor, NewtonOptions& options);

// Beyond the thesis, which blurs by hand where matching fails (5.1.3): a climb on larger, rounder cells goes first.
struct NdtCoarseOptions {
  double cell_m = 2.0;  // 0: no coarse climb.
  double min_flatness = 0.03;
};
void Visit(OptionVisitor& visitor, NdtCoarseOptions& options);

struct NdtOptions {
  NdtCoarseOptions coarse;
  NdtMapOptions map;
  ThinningOptions thinning;
  NewtonOptions newton;
  NdtEvidenceOptions evidence;
};
void Visit(OptionVisitor& visitor, NdtOptions& options);

struct NewtonResult {
  Pose2 T_map_points;
  int iterations = 0;
  bool settled = false;  // The last step was shorter than stop_step_*: a maximum, or a cut between cells.
};

// Climbs to the nearest maximum of the score. Directions in which the score is not concave are climbed by the size of
// their curvature (the Hessian made definite), and a step that does not raise the score is halved.
[[nodiscard]] NewtonResult ClimbNdt(const NdtMap& map, std::span<const Eigen::Vector2d> points, const Pose2& T_start,
                                    const NewtonOptions& options);

// Starts at the prior. One core is enough for it: `parallel_for` is there because all matchers are called alike.
[[nodiscard]] MatchResult MatchByNdt(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                                     const NdtOptions& options, const ParallelFor& parallel_for);

}  // namespace cairn::slam
