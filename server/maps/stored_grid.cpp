#include "server/maps/stored_grid.h"

#include <algorithm>
#include <utility>

namespace cairn::server {

StoredGrid ToStored(const RobotGrid& grid) {
  StoredGrid stored{.keyframes = grid.keyframes,
                    .chunks = {},
                    .path = grid.path,
                    .numbers = grid.numbers,
                    .drawn = grid.drawn,
                    .fragment = grid.fragment};
  for (const auto& [key, chunk] : grid.chunks) {
    stored.chunks.push_back({key.x, key.y, std::shared_ptr<const std::int16_t>(chunk, chunk->log_odds.data())});
  }
  return stored;
}

RobotGrid FromStored(const StoredGrid& stored) {
  RobotGrid grid{.chunks = {},
                 .keyframes = stored.keyframes,
                 .path = stored.path,
                 .numbers = stored.numbers,
                 .drawn = stored.drawn,
                 .fragment = stored.fragment};
  for (const StoredChunk& one : stored.chunks) {
    auto chunk = std::make_shared<slam::GridChunk>();
    std::copy_n(one.cells.get(), chunk->log_odds.size(), chunk->log_odds.begin());
    grid.chunks.emplace(slam::ChunkKey{one.x, one.y}, std::move(chunk));
  }
  return grid;
}

}  // namespace cairn::server
