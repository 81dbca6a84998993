#include "common/map/occupancy_image.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "common/map/raster_image.h"

namespace cairn {
namespace {

struct TileBox {
  std::int64_t x_min = 0, y_min = 0, x_max = 0, y_max = 0;  // Inclusive.
};

Result<TileBox> BoundingBox(const std::vector<Tile>& tiles) {
  std::set<TileKey> seen;
  TileBox box{tiles[0].key.x, tiles[0].key.y, tiles[0].key.x, tiles[0].key.y};
  for (const Tile& tile : tiles) {
    const std::string name = "tile (" + std::to_string(tile.key.x) + ", " + std::to_string(tile.key.y) + ")";
    if (tile.key.level != 0) return Fail(StatusCode::kInvalidArgument, name + " is not of level 0");
    if (!seen.insert(tile.key).second) return Fail(StatusCode::kInvalidArgument, name + " is given twice");
    box.x_min = std::min<std::int64_t>(box.x_min, tile.key.x);
    box.y_min = std::min<std::int64_t>(box.y_min, tile.key.y);
    box.x_max = std::max<std::int64_t>(box.x_max, tile.key.x);
    box.y_max = std::max<std::int64_t>(box.y_max, tile.key.y);
  }
  const std::int64_t columns = box.x_max - box.x_min + 1, rows = box.y_max - box.y_min + 1;
  constexpr std::int64_t kMostTiles = kMaxImagePixels / kTileArea;
  if (columns > kMostTiles || rows > kMostTiles || columns * rows > kMostTiles) {
    return Fail(StatusCode::kResourceExhausted, "a map of " + std::to_string(columns) + " x " + std::to_string(rows) +
                                                    " tiles is too large for one image");
  }
  return box;
}

}  // namespace

Result<OccupancyImage> AssembleTiles(const std::vector<Tile>& tiles, double level0_resolution_m) {
  constexpr double kFinest_m = 0.001;
  if (!std::isfinite(level0_resolution_m) || level0_resolution_m < kFinest_m) {
    return Fail(StatusCode::kInvalidArgument, "the resolution must be at least 0.001 m");
  }
  OccupancyImage image;
  image.resolution_m = level0_resolution_m;
  if (tiles.empty()) return image;
  const auto box = BoundingBox(tiles);
  if (!box) return tl::unexpected(box.error());
  image.width = static_cast<int>((box->x_max - box->x_min + 1) * kTileCells);
  image.height = static_cast<int>((box->y_max - box->y_min + 1) * kTileCells);
  image.T_map_origin.x = static_cast<double>(box->x_min * kTileCells) * level0_resolution_m;
  image.T_map_origin.y = static_cast<double>(box->y_min * kTileCells) * level0_resolution_m;
  const auto width = static_cast<std::ptrdiff_t>(image.width);
  image.cells.assign(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), kUnknownCell);
  for (const Tile& tile : tiles) {
    const auto cells = DecodeCells(tile.bytes, tile.encoding);
    if (!cells) return tl::unexpected(cells.error());
    const auto left = static_cast<std::ptrdiff_t>((tile.key.x - box->x_min) * kTileCells);
    const auto bottom = static_cast<std::ptrdiff_t>((tile.key.y - box->y_min) * kTileCells);
    for (std::ptrdiff_t y = 0; y < kTileCells; ++y) {
      std::copy_n(cells->begin() + y * kTileCells, kTileCells, image.cells.begin() + (bottom + y) * width + left);
    }
  }
  return image;
}

}  // namespace cairn
