#include "server/slam/grid/grid_image.h"

#include <algorithm>
#include <limits>

namespace cairn::slam {

OccupancyImage ImageOf(const OccupancyGrid& grid) {
  OccupancyImage image;
  image.resolution_m = grid.options().resolution_m;
  if (grid.chunk_count() == 0) return image;
  constexpr int kFar = std::numeric_limits<int>::max();
  ChunkKey low{kFar, kFar}, high{-kFar, -kFar};
  grid.ForEachChunk([&](const ChunkKey& key, const GridChunk& /*chunk*/) {
    low = {std::min(low.x, key.x), std::min(low.y, key.y)};
    high = {std::max(high.x, key.x), std::max(high.y, key.y)};
  });
  image.width = (high.x - low.x + 1) * kTileCells;
  image.height = (high.y - low.y + 1) * kTileCells;
  const double chunk_m = kTileCells * image.resolution_m;
  image.T_map_origin = {low.x * chunk_m, low.y * chunk_m, 0.0};
  const auto width = static_cast<std::size_t>(image.width);
  image.cells.assign(width * static_cast<std::size_t>(image.height), kUnknownCell);
  grid.ForEachChunk([&](const ChunkKey& key, const GridChunk& chunk) {
    const auto column = static_cast<std::size_t>((key.x - low.x) * kTileCells);
    const auto row = static_cast<std::size_t>((key.y - low.y) * kTileCells);
    const TileCells cells = OccupanciesOf(chunk);
    for (std::size_t y = 0; y < kTileCells; ++y)
      std::copy_n(cells.begin() + static_cast<std::ptrdiff_t>(y * kTileCells), kTileCells,
                  image.cells.begin() + static_cast<std::ptrdiff_t>((row + y) * width + column));
  });
  return image;
}

}  // namespace cairn::slam
