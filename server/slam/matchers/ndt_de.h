// Scan matching by the normal distributions transform, searched by differential evolution: finds the motion
// anywhere in the search space around the prior, without odometry and without derivatives. Newton's algorithm
// then refines the result (not in the thesis; can be switched off).
// Frames: both scans in their robot frames; returns T_ref_curr. In the thesis the y axis points ahead of the
// robot, here it is x: its (dx, dy) are (-dy, dx) here. Stateless, thread-safe; the random engine starts from
// `seed` at every match, and the result does not depend on how `parallel_for` splits the work.
// Source: thesis C 4.4.1 (4.42)-(4.43), Tables 4.4 and 4.5; 4.4.3 (thinning).
#pragma once

#include "server/slam/matchers/differential_evolution.h"
#include "server/slam/matchers/ndt.h"

namespace cairn::slam {

// The search space of Table 4.4, along the robot's axes at the prior: the robot moves mostly ahead, hardly
// back and hardly sideways.
struct NdtSearchOptions {
  double back_m = 0.5;
  double ahead_m = 1.0;
  double aside_m = 0.25;
  double turn_rad = kPi / 9.0;
};
void Visit(OptionVisitor& visitor, NdtSearchOptions& options);

struct NdtDeOptions {
  std::int64_t seed = 1;
  NdtMapOptions map;
  ThinningOptions thinning;
  NdtSearchOptions search;
  EvolutionOptions evolution;
  bool climb = true;
  NewtonOptions newton;
  NdtEvidenceOptions evidence;
};
void Visit(OptionVisitor& visitor, NdtDeOptions& options);

// The result, and the values by which the thesis judges it.
struct NdtDeMatch {
  MatchResult result;
  Pose2 T_evolved;  // The best pose of the evolution, neither refined nor fused with the prior.
  // (4.43) at T_evolved: self_score minus its score. By the thesis a value below 30 is probably right.
  double fitness = 0.0;
  double self_score = 0.0;  // A: score of the reference scan in its own distributions.
  int generations = 0;
};

// The thesis computes A from the whole previous scan but scores the thinned current scan; its fitness could
// then never be as small as it prints (181 points against 59). Corrected: A is computed from the thinned
// previous scan.
[[nodiscard]] NdtDeMatch SearchNdt(std::span<const Eigen::Vector2d> points_ref,
                                   std::span<const Eigen::Vector2d> points_curr, const MatchPrior& prior,
                                   const NdtDeOptions& options, const ParallelFor& parallel_for);

[[nodiscard]] MatchResult MatchByDifferentialEvolution(const ScanView& ref, const ScanView& curr,
                                                       const MatchPrior& prior, const NdtDeOptions& options,
                                                       const ParallelFor& parallel_for);

}  // namespace cairn::slam
