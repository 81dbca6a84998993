// A chunk of which all cells are the same.
#pragma once

#include <cstdint>
#include <memory>

#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

inline std::shared_ptr<const slam::GridChunk> UniformChunk(std::int16_t log_odds) {
  auto chunk = std::make_shared<slam::GridChunk>();
  chunk->log_odds.fill(log_odds);
  return chunk;
}

}  // namespace cairn::server
