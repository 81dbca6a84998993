// Tests whether the uncertainty that a filter states is right. The filter runs many times, with different seeds, in a
// simulated world whose noise is exactly the noise that the filter assumes, and its errors are compared with its stated
// uncertainty. The world is a loop driven several times past corners with known places; what the
// front-end would do (steps, features, revisits) is drawn, not computed. FastSLAM 1.0 gets steps drawn from
// its own motion model, the others from the drift. Source: Bar-Shalom, Li, Kirubarajan 2001, 5.4 (NEES, NIS
// and their bounds); Bailey et al. 2006 (FastSLAM).
#pragma once

#include <cstdint>
#include <vector>

#include "server/slam/methods.h"

namespace cairn::studies {

struct ConsistencyOptions {
  slam::FilterKind kind = slam::FilterKind::kFastSlam2Points;
  int runs = 100;
  std::int64_t particles = 200;
  int rounds = 2;  // Of the loop: 12 x 8 m, 40 m around.
  bool landmarks = true;
  bool revisits = false;
  std::uint64_t first_seed = 1;
  // Ratio of the noise of the world to the noise that the filter assumes. A ratio other than 1 shows that the test can
  // fail.
  double noise_factor = 1.0;
};

// Averages over all runs at one place of the way.
struct ConsistencyPoint {
  double travelled_m = 0.0;
  // NEES of (x, y, theta): 3 if the filter is consistent, more if it states too small an uncertainty.
  double nees = 0.0;
  // NIS of the keyframes since the previous point: 1 if the filter is consistent.
  double nis_per_number = 0.0;
  double nis_low = 0.0;  // 95 % of consistent filters lie between.
  double nis_high = 0.0;
  double effective_sample_size = 0.0;
  double ancestry_depth = 0.0;    // Keyframes back to the last one all particles agree on; 0 for one hypothesis.
  double position_error_m = 0.0;  // Root mean square.
};

struct ConsistencyResult {
  std::vector<ConsistencyPoint> points;
  double nees_low = 0.0;  // 95 % of consistent filters lie between, at every point.
  double nees_high = 0.0;
  double nees_mean = 0.0;    // Over all points,
  double nees_before = 0.0;  // over those before anything of the loop's beginning is seen again,
  double nees_after = 0.0;   // and over the others.
  double nees_inside = 0.0;  // Share of points inside the bounds.
  double nis_per_number = 0.0;
  double nis_low = 0.0, nis_high = 0.0;  // Of the whole.
  double position_error_m = 0.0;         // At the end, root mean square.
  int diverged = 0;                      // Runs whose last report was "diverged".
  std::size_t landmarks = 0;             // Of the last run; the world has ConsistencyLandmarks().
};

[[nodiscard]] std::size_t ConsistencyLandmarks();
// Deterministic. Takes about 10 ms a run with 200 particles. Not for dpslam, which needs ranges rather than
// features.
[[nodiscard]] ConsistencyResult StudyConsistency(const ConsistencyOptions& options);

}  // namespace cairn::studies
