// Options of DP-SLAM: both levels, the joints between segments, the opacity model.
// Source: Eliazar, Parr 2004, 2005; thesis C 3.2.3, 4.5, 6.1 (when a segment may end).
#pragma once

#include <cstdint>

#include "server/slam/dpslam/level_filter.h"
#include "server/slam/dpslam/opacity.h"
#include "server/slam/motion/learnt_motion.h"

namespace cairn::slam {

struct SegmentOptions {
  double length_m = 12.0;        // Travelled before a segment may end. Longer: fewer joints, more drift within.
  double straight_rad = 0.15;    // A segment does not end within a turn faster than this a step ...
  std::int64_t max_scans = 150;  // ... unless it has grown this long.
  // The low level goes on so long before a segment is handed up: which of its lineages was right shows afterwards.
  // (Robot 3 of the study's loop, 60 + 60 particles: heading 8.5 deg off after 100 m without, 0.2 deg with. One robot
  // only.)
  std::int64_t hindsight_scans = 10;
  double keep_m = 25.0;  // The low level forgets what is farther away; more than the laser sees.
  std::int64_t trajectories =
      1;  // Handed up for the high level to choose from: the best, then others of the low level.
};

// A rigid trajectory leaves less room for small corrections, hence the larger sigma (Eliazar 2005: 7 cm). The drift,
// the most that particles draw, is what the low level was seen to err by on raw odometry over segments of 12.7 m of the
// study's office (150 particles, robots 6-15): 0.10 m and 0.09 m along and across, 0.85 deg; a few segments err by 3
// deg. Unseen space is less than neutral here: as good as a known wall, it draws particles to lay a way beside the old
// one that it should lie on (robot 16: loop error 6.7 m, then 0.15 m).
[[nodiscard]] inline LevelOptions HighLevel() {
  LevelOptions high;
  high.sigma_m = 0.07;
  high.evidence_share = 0.2;
  high.unseen_per_m = 0.3;
  high.ray_stride = 8;
  high.resample_below = 0.5;
  high.give_up_behind = 0.0;  // The hopeless move on.
  high.drift = {0.01, 0.007, 0.0, 0.001, 0.00125, 0.0};
  return high;
}

// What the low level's particles draw a step from. Gaussian: the front-end's step with low.drift. Eliazar: odometry's
// own step, as d and b of thesis C (4.46) are; what the front-end matched is left to the weights, and a jump of the
// odometry takes all particles along; without odometry the front-end's step stands in (4.5.1). Scan matching: the
// front-end's step, as in Tables 5.1-5.3.
enum class LowMotion : std::uint8_t { kGaussian = 0, kEliazar, kScanMatching };

struct DpSlamOptions {
  bool hierarchical = true;
  LowMotion motion = LowMotion::kGaussian;
  LearntMotion learnt{};  // Shown as slam.motion.
  OpacityOptions opacity;
  LevelOptions low;
  LevelOptions high = HighLevel();
  SegmentOptions segment;
  std::int64_t diverged_after = 20;  // Scans in a row that the map contradicts before the filter says it is lost.
};
void Visit(OptionVisitor& visitor, LowMotion& motion);       // The key `motion`.
void Visit(OptionVisitor& visitor, DpSlamOptions& options);  // All but `learnt`.

}  // namespace cairn::slam
