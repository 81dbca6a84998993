// How the grids that several sessions have drawn of the same place become one. Sessions of the same time add up,
// because log odds of independent evidence do. What an ended session has drawn may be out of date: where one that
// goes on, or ended later, has seen the same cell, it counts up to a limit only, so that what was moved meanwhile goes
// after a few looks. Where none of these has seen the cell, it stays as it is. Stateless, thread-safe.
#pragma once

#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

// Adds the cells of a later grid to a sum. Where both have seen a cell, the sum is first limited to +-`most`, in units
// of GridChunk::log_odds.
void AddLater(slam::GridChunk& sum, const slam::GridChunk& later, int most);

// The same for evidence of one time.
void AddBeside(slam::GridChunk& sum, const slam::GridChunk& other);

[[nodiscard]] slam::GridChunk UnseenChunk();

}  // namespace cairn::server
