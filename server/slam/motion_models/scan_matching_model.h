// The motion model of a robot without odometry: the motion that scan matching reports, plus the matcher's
// errors. The errors across and in heading are normally distributed, with a spread that grows with the
// motion. In the forward direction a matcher sometimes misses nearly the whole motion. Then the true motion
// is longer by lambda, the distance that the robot travels in one step at its present speed. This case is
// considered only if the matcher reports little turning.
// Frame: T_prev_curr in the robot frame, x forward (in the thesis y is forward, and its x is our y). m, rad.
// Source: thesis C 4.5.1 (Table 4.7), 5.2 (Tables 5.1-5.3). Corrected: Table 5.2 adds twelve uniform samples
// of (-1, 1) and scales the sum by v/6, which gives a standard deviation of v/3; v/2 would give v. Here a
// normal distribution is sampled. Table 5.3 compares the turn with its sign; the absolute value is meant.
#pragma once

#include <random>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct MatchSpread {
  double base = 0.0;  // Standard deviation without motion, m or rad.
  // Growth of the standard deviation per unit of the reported motion along this axis.
  double share = 0.0;
  [[nodiscard]] double Sigma(double reported) const;
};

struct ScanMatchingModel {
  MatchSpread along{0.02, 0.1};
  MatchSpread across{0.02, 0.1};
  MatchSpread turn{Radians(0.5), 0.1};
  double shortfall_share = 0.05;
  double shortfall_max_turn_rad = Radians(3.0);
};
void Visit(OptionVisitor& visitor, ScanMatchingModel& model);

// Whether the matcher may have missed part of the motion in this step: lambda is above zero and the reported
// turn is small.
[[nodiscard]] bool MayFallShort(const ScanMatchingModel& model, const Pose2& T_prev_curr_reported, double lambda_m);

// Returns a random sample of the true motion. `lambda_m` is the robot's speed times the duration of the step
// as far as known; 0 excludes a missed motion.
[[nodiscard]] Pose2 SampleMotion(const ScanMatchingModel& model, const Pose2& T_prev_curr, double lambda_m,
                                 std::mt19937_64& engine);

}  // namespace cairn::slam
