// The tiles in which a robot is localised: those of the map, but for walls that people have drawn. They draw walls that
// lidars do not see, such as glass, and beams that pass through a wall say that the robot is elsewhere. So these cells
// are unknown. Stateless, thread-safe.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "server/maps/map_snapshot.h"
#include "server/maps/shared_known_grids.h"
#include "server/slam/known_grid/known_grid.h"

namespace cairn::server {

// Of level 0. A tile without such walls is that of the map itself. Takes time for the area of the tiles that have some.
[[nodiscard]] std::vector<TileSet::TilePtr> TilesToLocaliseIn(const MapSnapshot& map);
// Those of the tiles of which a part lies within `reach_m` of a point, in x and in y.
[[nodiscard]] std::vector<TileSet::TilePtr> TilesNear(std::span<const TileSet::TilePtr> tiles, double resolution_m,
                                                      const Eigen::Vector2d& p_map, double reach_m);
// Whether the map is small enough for that (slam::KnownGrid::kMostM).
[[nodiscard]] bool IsSmallEnoughToLocaliseIn(const MapSnapshot& map);
// The map that tiles of level 0 show. Tiles that cannot be read are left out. Null: it is larger than a search allows
// (slam::KnownGrid::IsBounded). `near_m`: as slam::SelfCheckOptions. `shared`: where the same map may be already; null:
// it is made.
[[nodiscard]] std::shared_ptr<const slam::KnownGrid> KnownGridOf(std::span<const TileSet::TilePtr> tiles,
                                                                 double resolution_m, std::uint32_t epoch,
                                                                 const slam::PlaceSearchOptions& options, double near_m,
                                                                 SharedKnownGrids* shared = nullptr);

}  // namespace cairn::server
