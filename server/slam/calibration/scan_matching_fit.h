// Learns the motion model of a robot without odometry (motion_models/scan_matching_model.h) from steps whose
// true motion is known. Stateless, thread-safe, deterministic. m, rad.
#pragma once

#include <span>

#include "server/slam/motion_models/scan_matching_model.h"

namespace cairn::slam {

// One step whose true motion is known, or estimated better than by the matcher.
struct MatchSample {
  Pose2 reported;
  Pose2 truth;
  double lambda_m = 0.0;
};

struct ScanMatchingFit {
  ScanMatchingModel model;
  int samples = 0;
  int iterations = 0;
  double failure_share = 0.0;  // Share of the steps whose match is plainly wrong.
};

// Returns the most likely model. The spreads are found by Fisher scoring, within an expectation maximisation
// over the kind of each step: a match, a shortfall, or (not in the source) a failure, which may lie anywhere
// and must not widen the spreads. The turn limit is that of `start`. Without samples `start` is returned.
[[nodiscard]] ScanMatchingFit FitScanMatching(std::span<const MatchSample> samples, const ScanMatchingModel& start);

}  // namespace cairn::slam
