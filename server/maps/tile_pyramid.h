// Tiles of cells and their pyramid of coarser levels. A tile in which every cell is unknown is not kept. Not
// thread-safe.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "common/map/tile.h"

namespace cairn::server {

class TilePyramid {
 public:
  using Cells = std::shared_ptr<const TileCells>;

  // Replaces tiles of level 0 (null: every cell is unknown), and the tiles above them. Returns the keys of all levels
  // whose cells differ from those before.
  std::vector<TileKey> Update(const std::map<TileKey, Cells>& finest);
  [[nodiscard]] const std::map<TileKey, Cells>& cells() const { return cells_; }

 private:
  // Returns whether the cells differ from those before.
  bool Store(TileKey key, Cells cells);
  [[nodiscard]] Cells Reduce(TileKey parent) const;

  std::map<TileKey, Cells> cells_;
};

}  // namespace cairn::server
