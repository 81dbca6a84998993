// The published map: a pyramid of square tiles of occupancy cells. Cells are one byte: 0 free .. 100 occupied, 255
// unknown (OccupancyGrid's values with -1 as 255). Cell (0,0) of tile (0,0) has its lower-left corner at the map's
// origin; x grows with columns, y with rows; row-major from the lowest y. Level l has cells of resolution * 2^l.
// A tile is immutable once published and is replaced whole, never merged.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "common/status.h"

namespace cairn {

inline constexpr int kTileCells = 128;
inline constexpr int kTileArea = kTileCells * kTileCells;
inline constexpr std::uint8_t kUnknownCell = 255;
inline constexpr int kPyramidLevels = 4;  // Levels 0..3.

struct TileKey {
  int level = 0;
  int x = 0;  // In tiles of this level; negative left of the origin.
  int y = 0;
  auto operator<=>(const TileKey&) const = default;
};

using TileCells = std::array<std::uint8_t, kTileArea>;

enum class TileEncoding : std::uint8_t { kRaw = 0, kPng = 1 };

struct Tile {
  TileKey key;
  std::uint32_t epoch = 0;
  std::uint64_t version = 0;  // The site's map version in which this tile last changed; grows over all tiles of a site.
  TileEncoding encoding = TileEncoding::kPng;
  std::vector<std::uint8_t> bytes;  // < 64 KB.
};

// PNG: 8-bit grey, 128 x 128, image row 0 = lowest y (the cells as they are, no flip). Raw: the 16,384 cells.
[[nodiscard]] std::vector<std::uint8_t> EncodeCells(const TileCells& cells, TileEncoding encoding);
[[nodiscard]] Result<TileCells> DecodeCells(const std::vector<std::uint8_t>& bytes, TileEncoding encoding);

// The parent's quarter is the maximum of each 2 x 2 block's known cells (an obstacle never vanishes in a coarser
// level); unknown only where all four are. `children` are (0,0), (1,0), (0,1), (1,1); null = unknown.
[[nodiscard]] TileCells ReduceTiles(const std::array<const TileCells*, 4>& children);

// Floor division that also holds for negative cells.
[[nodiscard]] constexpr int FloorDiv(int a, int b) {
  return a >= 0 ? a / b : -((-a + b - 1) / b);
}

}  // namespace cairn
