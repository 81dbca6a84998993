// Scan matching by the normal distributions transform, searched by differential evolution: finds the motion anywhere in
// the search space around the prior, without odometry and without derivatives. Then Newton's algorithm climbs the last
// millimetres (beyond the thesis; can be switched off).
// Frames: both scans in their robot frames; answers T_prev_curr. The thesis' y axis points ahead of the robot, ours
// is x: its (dx, dy) are our (-dy, dx). Stateless, thread-safe; the random engine starts from `seed` at every match,
// and the answer does not depend on how `parallel_for` splits the work. Source: thesis C 4.4.1 (4.42)-(4.43),
// Tables 4.4 and 4.5; 4.4.3 (thinning).
#pragma once

#include "server/slam/matching/differential_evolution.h"
#include "server/slam/matching/ndt.h"

namespace cairn::slam {

// Table 4.4, in the robot's axes at the prior: a robot that goes ahead, hardly back, and does not slide.
struct NdtSearchOptions {
  double back_m = 0.5;
  double ahead_m = 1.0;
  double aside_m = 0.25;        // Either way.
  double turn_rad = kPi / 9.0;  // Either way, 20 degrees. Larger: faster turns are found, and more wrong answers.
};
void Visit(OptionVisitor& visitor, NdtSearchOptions& options);

struct NdtDeOptions {
  std::int64_t seed = 1;
  NdtMapOptions map;
  ThinningOptions thinning;
  NdtSearchOptions search;
  EvolutionOptions evolution;
  bool climb = true;  // Newton's algorithm after the evolution.
  NewtonOptions newton;
  NdtEvidenceOptions evidence;
};
void Visit(OptionVisitor& visitor, NdtDeOptions& options);

// The answer and what the thesis judges it by.
struct NdtDeMatch {
  MatchResult result;
  Pose2 T_evolved;          // The evolution's best as it is, neither climbed nor joined with the prior.
  double fitness = 0.0;     // (4.43) at the evolution's best: A minus its score. The thesis: below 30 likely right.
  double self_score = 0.0;  // A, of the previous scan in its own distributions.
  int generations = 0;
};

// The thesis takes A from the whole previous scan but scores the thinned current one: its fitness could then never be
// as small as it prints (181 points against 59). Corrected: A is of the thinned previous scan.
[[nodiscard]] NdtDeMatch SearchNdt(std::span<const Eigen::Vector2d> points_prev,
                                   std::span<const Eigen::Vector2d> points_curr, const MatchPrior& prior,
                                   const NdtDeOptions& options, const ParallelFor& parallel_for);

[[nodiscard]] MatchResult MatchByDifferentialEvolution(const ScanView& prev, const ScanView& curr,
                                                       const MatchPrior& prior, const NdtDeOptions& options,
                                                       const ParallelFor& parallel_for);

}  // namespace cairn::slam
