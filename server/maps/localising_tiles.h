// The tiles in which a robot is localised: those of the map, but for walls that people have drawn. They draw walls that
// lidars do not see, such as glass, and beams that pass through a wall say that the robot is elsewhere. So these cells
// are unknown. Stateless, thread-safe.
#pragma once

#include <vector>

#include "server/maps/map_snapshot.h"

namespace cairn::server {

// Of level 0. A tile without such walls is that of the map itself. Takes time for the area of the tiles that have some.
[[nodiscard]] std::vector<TileSet::TilePtr> TilesToLocaliseIn(const MapSnapshot& map);

}  // namespace cairn::server
