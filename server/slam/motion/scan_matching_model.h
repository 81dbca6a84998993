// The motion model of a robot without odometry: what scan matching reports, plus the matcher's errors. Across and in
// heading they are normal, wider for larger motions. Forwards a matcher sometimes sees hardly any of the way: then the
// true motion is longer by lambda, the way the robot makes in a step at its present speed. That is only believed where
// the matcher reports little turning.
// Frame: T_prev_curr in the robot frame, x forward (the thesis has y forward: its x is our y). m, rad.
// Source: thesis C 4.5.1 (Table 4.7), 5.2 (Tables 5.1-5.3). Corrected: Table 5.2 adds twelve uniform draws of (-1, 1)
// and scales by v/6, which gives a third of v; v/2 would give v, here a normal draw does. Table 5.3 compares the turn
// without its sign; |turn| is meant.
#pragma once

#include <random>
#include <span>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/motion/spread_fit.h"

namespace cairn::slam {

struct MatchSpread {
  double base = 0.0;   // m or rad.
  double share = 0.0;  // Of the reported motion of this axis.
  [[nodiscard]] double Sigma(double reported) const;
};

struct ScanMatchingModel {
  MatchSpread along{0.02, 0.1};
  MatchSpread across{0.02, 0.1};
  MatchSpread turn{Radians(0.5), 0.1};
  double shortfall_share = 0.05;                 // How often the matcher misses the way.
  double shortfall_max_turn_rad = Radians(3.0);  // Above it never.
};
void Visit(OptionVisitor& visitor, ScanMatchingModel& model);

// A draw of the true motion. `lambda_m`: the robot's speed times the time of the step, as far as known; 0: no
// shortfall.
[[nodiscard]] Pose2 SampleMotion(const ScanMatchingModel& model, const Pose2& T_prev_curr, double lambda_m,
                                 std::mt19937_64& engine);

// One step whose truth is known, or estimated better than by the matcher.
struct MatchSample {
  Pose2 reported;
  Pose2 truth;
  double lambda_m = 0.0;
};

struct ScanMatchingFit {
  ScanMatchingModel model;
  int samples = 0;
  int iterations = 0;
  double failure_share = 0.0;  // Of the steps: matches that are plainly wrong.
};

// The most likely model: spreads by Fisher scoring, within an expectation maximisation over what each step is: a match,
// a shortfall, or (beyond the source) a failure, which may lie anywhere and must not widen the spreads. The turn limit
// is the start's. Without samples the start is returned.
[[nodiscard]] ScanMatchingFit FitScanMatching(std::span<const MatchSample> samples, const ScanMatchingModel& start);

}  // namespace cairn::slam
