// The map in which a robot localises itself, from the grid that another robot has drawn.
#pragma once

#include <memory>
#include <utility>

#include "server/slam/known_grid/known_grid.h"
#include "server/slam/mapper_options.h"

namespace cairn::slam::test {

inline std::shared_ptr<const KnownGrid> KnownGridOf(const OccupancyGrid& grid, const MapperOptions& options = {}) {
  KnownGrid::Tiles tiles;
  grid.ForEachChunk([&](const ChunkKey& key, const GridChunk& chunk) {
    tiles.emplace(key, std::make_shared<const TileCells>(OccupanciesOf(chunk)));
  });
  return std::make_shared<const KnownGrid>(KnownGrid::Source{std::move(tiles), grid.options().resolution_m, 0},
                                           options.recovery.place, options.self_check.near_m);
}

}  // namespace cairn::slam::test
