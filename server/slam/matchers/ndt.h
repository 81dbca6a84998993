// Scan matching by the normal distributions transform: moves the points of one scan to where the
// distributions of the other are densest, by Newton's algorithm with the exact gradient and Hessian. It needs
// neither correspondences nor features. Not a global search: the initial error must be below about half a
// cell and 15 degrees (ndt_de searches).
// Frames: both scans in their robot frames; returns T_ref_curr. Stateless, thread-safe.
// Source: Biber and Strasser, IROS 2003; thesis C 2.3.3 (2.14)-(2.19).
#pragma once

#include "server/slam/features/scan_view.h"
#include "server/slam/matchers/ndt_evidence.h"
#include "server/slam/parallel_for.h"
#include "server/slam/scan/thinning.h"

namespace cairn::slam {

struct NewtonOptions {
  std::int64_t max_iterations = 40;
};
void Visit(OptionVisitor& visitor, NewtonOptions& options);

// Not in the thesis, which enlarges the distributions by hand where matching fails (5.1.3): a first
// optimisation on larger and rounder cells.
struct NdtCoarseOptions {
  double cell_m = 2.0;
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
  // The last step was shorter than the limits. The pose is then a maximum, or lies on a boundary between
  // cells.
  bool settled = false;
};

// Finds the nearest maximum of the score. In directions in which the score is not concave, the absolute value
// of the curvature is used (which makes the Hessian definite), and a step that does not raise the score is
// halved.
[[nodiscard]] NewtonResult ClimbNdt(const NdtMap& map, std::span<const Eigen::Vector2d> points, const Pose2& T_start,
                                    const NewtonOptions& options);

// Starts at the prior. One thread is fast enough, so `parallel_for` is not used; it is a parameter because
// all matchers have the same signature.
[[nodiscard]] MatchResult MatchByNdt(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                                     const NdtOptions& options, const ParallelFor& parallel_for);

}  // namespace cairn::slam
