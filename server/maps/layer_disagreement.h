// Where the grids that several sessions have drawn of the same place differ: robots that see it differently, or what
// has changed since an earlier run. Stateless, thread-safe.
#pragma once

#include <memory>
#include <span>

#include "common/map/tile.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

// By how much several grids of the same place differ: for each cell that at least two have seen, how much more occupied
// it is for one of them than it and its neighbours are for another one, 0..100; unknown elsewhere, and in the cells at
// the border of the chunk. Differences of at most 50 count as 0. Null where there is no other one.
[[nodiscard]] std::shared_ptr<const TileCells> DisagreementOf(std::span<const slam::GridChunk* const> grids);

}  // namespace cairn::server
