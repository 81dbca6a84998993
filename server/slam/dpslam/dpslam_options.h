// Options of DP-SLAM: both levels, the joints between segments, the opacity model.
// Source: Eliazar, Parr 2004, 2005; thesis C 3.2.3, 4.5, 6.1 (when a segment may end).
#pragma once

#include <cstdint>

#include "server/slam/dpslam/level_filter.h"
#include "server/slam/dpslam/opacity.h"

namespace cairn::slam {

struct SegmentOptions {
  double length_m = 6.0;            // Travelled before a segment may end. Longer: fewer joints, more drift within.
  double straight_rad = 0.15;       // A segment does not end within a turn faster than this a step ...
  std::int64_t max_scans = 150;     // ... unless it has grown this long.
  std::int64_t overlap_scans = 12;  // Of the segment before, drawn on the new one's map so that it starts knowing.
  std::int64_t trajectories = 4;    // Of the low level's particles, handed up for the high level to choose from.
};

struct DpSlamOptions {
  bool hierarchical = true;
  OpacityOptions opacity;
  LevelOptions low{500, 0.05, 0.15, 0.05, 1.0, 1, 12.0, 0.5, {0.004, 0.05, 0.01, 0.001, 0.01, 0.05}};
  LevelOptions high{500, 0.07, 0.02, 0.05, 1.0, 4, 12.0, 0.5, {0.01, 0.008, 0.0, 0.002, 0.002, 0.0}};
  SegmentOptions segment;
  std::int64_t diverged_after = 20;  // Scans in a row that the map contradicts before the filter says it is lost.
};
void Visit(OptionVisitor& visitor, DpSlamOptions& options);

}  // namespace cairn::slam
