// The part of one particle's map that rays can reach, as a raster of stop rates, so that a look-up needs one
// memory access. Changing from one particle to a relative removes and adds only the changes between them in
// the ancestry tree. A walk over all living particles thus applies each change of the tree once, however many
// particles inherit it. (DP-SLAM 2.0 reaches the same bound, area swept times particles, with a cache per
// grid cell.) Cells outside of the window count as unseen. Not thread-safe; one window per thread.
// Source: Eliazar, Parr 2004 (local maps); thesis C 3.2.3.2.
#pragma once

#include <vector>

#include "server/slam/dpslam/ancestry.h"

namespace cairn::slam {

// A box of whole tiles of the map, [low, low + size).
struct TileBox {
  int low_x = 0, low_y = 0;
  int width = 0, height = 0;
  bool operator==(const TileBox&) const = default;
};

class OpacityWindow {
 public:
  OpacityWindow(const Ancestry& ancestry, const TileBox& box, const StopRate& rate);

  // Loads the map of this particle.
  void Show(Ancestry::Id id);

  // The window's first cell in cells of the map, and its size in cells.
  [[nodiscard]] int low_x() const { return box_.low_x << kTileBits; }
  [[nodiscard]] int low_y() const { return box_.low_y << kTileBits; }
  [[nodiscard]] int width() const { return box_.width << kTileBits; }
  [[nodiscard]] int height() const { return box_.height << kTileBits; }
  // Stops per cell-width of travel, row by row; 0 if nothing has been seen (a seen cell is never 0).
  [[nodiscard]] const float* rates() const { return rates_.data(); }
  [[nodiscard]] const std::vector<CellCounts>& counts() const { return counts_; }

 private:
  template <int Sign>
  void Apply(const MapChanges& changes);

  const Ancestry& ancestry_;
  const TileBox box_;
  const StopRate rate_;
  std::vector<CellCounts> counts_;
  std::vector<float> rates_;
  std::vector<Ancestry::Id> line_, next_line_;
};

}  // namespace cairn::slam
