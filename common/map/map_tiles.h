// A map that comes from a file as tiles: its cells along the axes of the map frame, and of the size that a server uses.
// Stateless, thread-safe.
#pragma once

#include <map>

#include "common/map/occupancy_image.h"
#include "common/map/tile.h"

namespace cairn {

// A robot is not looked for where the tiles of a map reach farther.
inline constexpr double kMostMapSide_m = 1000.0;

// The tiles of level 0 with cells of `resolution_m`, without those in which every cell is unknown. A cell is what the
// map says at its centre. Where the cells of the map are smaller, it is the largest known value in it, so that no wall
// vanishes. INVALID_ARGUMENT: the map is empty or not whole, nothing in it is known, or its cells are too small or too
// large. OUT_OF_RANGE: it is larger than kMostMapSide_m, or lies too far from the origin. RESOURCE_EXHAUSTED: it would
// have more than kMaxImagePixels cells.
[[nodiscard]] Result<std::map<TileKey, TileCells>> ResampleToTiles(const OccupancyImage& map, double resolution_m);

}  // namespace cairn
