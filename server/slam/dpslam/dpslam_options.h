// Options of DP-SLAM: both levels, the joints between segments, the opacity model.
// Source: Eliazar, Parr 2004, 2005; thesis C 3.2.3, 4.5, 6.1 (when a segment may end).
#pragma once

#include <cstdint>

#include "server/slam/dpslam/level_filter.h"
#include "server/slam/dpslam/opacity.h"
#include "server/slam/motion_models/learnt_motion.h"

namespace cairn::slam {

struct SegmentOptions {
  double length_m = 12.0;
  double straight_rad = 0.15;
  std::int64_t max_scans = 150;
  double keep_m = 25.0;
  std::int64_t trajectories = 1;
};

// Defaults of the high level. A rigid trajectory leaves less room for small corrections, hence the larger
// sigma (Eliazar 2005: 7 cm). The drift is the largest that particles draw. It is the error that the low
// level was seen to make on raw odometry over segments of 12.7 m of the study's office (150 particles, robots
// 6-15): 0.10 m along, 0.09 m across and 0.85 deg; a few segments have an error of 3 deg. The density of
// unseen space is below the neutral value: at the density of a well explained wall, particles tend to put a
// path beside an earlier one on which it should lie (robot 16: loop error 6.7 m, with the lower density 0.15
// m).
[[nodiscard]] inline LevelOptions HighLevel() {
  LevelOptions high;
  high.sigma_m = 0.07;
  high.evidence_share = 0.2;
  high.unseen_per_m = 0.3;
  high.ray_stride = 8;
  high.resample_below = 0.5;
  high.give_up_behind = 0.0;  // No particle is given up: unlikely ones can still move.
  high.drift = {0.01, 0.007, 0.0, 0.001, 0.00125, 0.0};
  return high;
}

// The distribution from which the low level's particles draw a step. Gaussian: the front-end's step with the
// noise low.drift. Eliazar: the step by odometry, since d and b of thesis C (4.46) are odometry; the match
// acts through the weights only, and a jump of the odometry moves all particles; without odometry the
// front-end's step is used (4.5.1). Scan matching: the front-end's step, as in Tables 5.1-5.3.
enum class LowMotion : std::uint8_t { kGaussian = 0, kEliazar, kScanMatching };

// The method by which the high level joins segments. Both use the options `high`.
enum class HighLevelKind : std::uint8_t {
  // Our method (segment_filter.h): particles draw different shares of the drift, are compared with what the
  // low
  // level had forgotten, and move.
  kMoving = 0,
  // The method of thesis C 4.5.2: at every joint each particle draws all of the drift, is weighted by the
  // whole
  // segment in its own map, resampled, and draws the segment. The low level then begins a new map at the joint.
  // There is no hindsight, and `segment.keep_m` and `trajectories` have no effect.
  kPlain,
};

struct DpSlamOptions {
  bool hierarchical = true;
  HighLevelKind high_level = HighLevelKind::kMoving;
  LowMotion motion = LowMotion::kGaussian;
  LearntMotion learnt{};  // In the configuration this is slam.motion.
  OpacityOptions opacity;
  LevelOptions low;
  LevelOptions high = HighLevel();
  SegmentOptions segment;
  std::int64_t diverged_after = 20;
};
void Visit(OptionVisitor& visitor, LowMotion& motion);       // Reads the key `motion`.
void Visit(OptionVisitor& visitor, DpSlamOptions& options);  // Reads all fields but `learnt`.

}  // namespace cairn::slam
