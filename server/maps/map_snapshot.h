// A site's published map at one moment: immutable, shared, safe to read anywhere. Successive snapshots share the tiles
// that did not change.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "common/map/tile.h"
#include "common/sensor/trajectory.h"
#include "common/service/map_info.h"

namespace cairn::server {

struct MapSnapshot {
  MapInfo info;
  std::map<TileKey, std::shared_ptr<const Tile>> tiles;  // All levels.
  // Smoothed paths by robot: of the enabled map version, or of the newest that has any.
  std::map<std::string, std::shared_ptr<const Trajectory>> smoothed;
};

}  // namespace cairn::server
