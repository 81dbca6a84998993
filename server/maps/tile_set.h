// The encoded tiles of a map by their keys. Immutable: a change makes another set, which shares with this one every
// block of 16 x 16 tiles that has no changed tile. Thread-safe.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>

#include "common/map/tile.h"

namespace cairn::server {

// The smallest box that contains tiles of one level, in tiles; its maximum is inclusive.
struct TileBox {
  int x_min = 0, y_min = 0, x_max = 0, y_max = 0;
  std::size_t count = 0;  // Tiles in the box.
};

class TileSet {
 public:
  using TilePtr = std::shared_ptr<const Tile>;

  [[nodiscard]] bool empty() const { return blocks_.empty(); }
  [[nodiscard]] TilePtr Find(TileKey key) const;  // Null where there is none.
  // The set with these tiles in place of those with the same keys. Null: without this tile.
  [[nodiscard]] TileSet With(const std::map<TileKey, TilePtr>& changes) const;

  // Calls `act` with each tile (TilePtr) of the level.
  template <typename Act>
  void ForEach(int level, Act act) const {
    for (auto block = FirstOf(level); block != blocks_.end() && block->first.level == level; ++block) {
      for (const auto& [key, tile] : block->second->tiles) act(tile);
    }
  }
  // Nothing where the level has no tile. Takes time for each block, not for each tile.
  [[nodiscard]] std::optional<TileBox> BoxOf(int level) const;

 private:
  static constexpr int kBlockSide = 16;  // Tiles.
  struct Block {
    std::map<TileKey, TilePtr> tiles;
    TileBox box;
  };
  using Blocks = std::map<TileKey, std::shared_ptr<const Block>>;  // By level and place, in blocks.

  static TileKey BlockOf(TileKey key);
  static TileBox BoxAround(const std::map<TileKey, TilePtr>& tiles);
  Blocks::const_iterator FirstOf(int level) const;

  Blocks blocks_;  // None is empty.
};

}  // namespace cairn::server
