// Draws a robot's whole map again along a corrected path, a few keyframes at a time, so that no scan waits for it.
// Not thread-safe.
#pragma once

#include <span>
#include <utility>

#include "server/slam/filters/shared_sequence.h"
#include "server/slam/grid/occupancy_grid.h"
#include "server/slam/keyframe.h"

namespace cairn::slam {

class GridRedraw {
 public:
  explicit GridRedraw(const GridOptions& options) : grid_(options) {}

  // Draws up to `count` more keyframes at their poses in `path` (one per keyframe); true once all are drawn.
  bool Advance(std::span<const Keyframe> keyframes, const SharedSequence<Pose2>& path, std::size_t count);

  // What was drawn; REQUIRES: nothing is drawn afterwards.
  [[nodiscard]] OccupancyGrid TakeGrid() { return std::move(grid_); }

 private:
  OccupancyGrid grid_;
  std::size_t drawn_ = 0;
};

}  // namespace cairn::slam
