// What one particle changed of the map it inherited: per cell, laser travel and stops to be added to its ancestors'.
// Kept as increments (not as new totals), so an ancestor and its only child merge by adding, whichever is the smaller
// into the larger, and a map is the sum along a line of ancestors, in any order.
// In square tiles of 64 x 64 cells: a short sorted list where little was changed, all cells where much was.
// Counts of one cell in one particle stay below 65536; where they would not, travel and stops are both halved (evidence
// ages, the opacity stays). So the sum over 10,000 ancestors cannot overflow 32 bits.
// Cell (0,0) has its lower-left corner at the map origin. Not thread-safe for writing.
// Source: thesis C 3.2.3.2; Eliazar, Parr 2003, 2004.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/slam/dpslam/opacity.h"

namespace cairn::slam {

inline constexpr int kTileBits = 6;
inline constexpr int kChangeTileSide = 1 << kTileBits;
inline constexpr int kChangeTileArea = kChangeTileSide * kChangeTileSide;

struct ChangeTileKey {
  int y = 0;
  int x = 0;
  auto operator<=>(const ChangeTileKey&) const = default;
};

struct CellChange {
  std::uint16_t cell = 0;  // y * 64 + x within the tile.
  std::uint16_t travel = 0;
  std::uint16_t stops = 0;
};

// Changes of one tile. Either `list`, ascending by cell, or `all`, 4096 entries.
struct ChangeTile {
  struct Counts {
    std::uint16_t travel = 0;
    std::uint16_t stops = 0;
  };
  ChangeTileKey key;
  std::vector<CellChange> list;
  std::vector<Counts> all;

  void Add(ChangeTile&& other);  // Of the same key.
  [[nodiscard]] std::size_t bytes() const;

  // visit(cell, travel, stops) for every changed cell, ascending.
  template <typename Visit>
  void ForEach(Visit&& visit) const {
    for (const CellChange& change : list) visit(change.cell, change.travel, change.stops);
    for (std::size_t cell = 0; cell < all.size(); ++cell)
      if ((all[cell].travel | all[cell].stops) != 0)
        visit(static_cast<std::uint16_t>(cell), all[cell].travel, all[cell].stops);
  }
};

class MapChanges {
 public:
  // REQUIRES: tiles are appended in ascending order of their keys.
  void Append(ChangeTile tile) { tiles_.push_back(std::move(tile)); }
  // Takes over the other's changes.
  void Add(MapChanges&& other);
  // Forgets what lies outside [low, high].
  void KeepOnly(const ChangeTileKey& low, const ChangeTileKey& high);

  [[nodiscard]] const std::vector<ChangeTile>& tiles() const { return tiles_; }
  [[nodiscard]] bool empty() const { return tiles_.empty(); }
  [[nodiscard]] std::size_t bytes() const;  // On the heap.

 private:
  std::vector<ChangeTile> tiles_;  // Ascending by key.
};

}  // namespace cairn::slam
