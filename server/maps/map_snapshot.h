// The published map of a site at one moment. It is immutable and may be read on any thread. Successive
// snapshots share the tiles that did not change.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "common/sensor/trajectory.h"
#include "common/service/map_info.h"
#include "server/maps/tile_set.h"

namespace cairn::server {

struct MapSnapshot {
  MapInfo info;
  TileSet tiles;  // All levels.
  // Smoothed paths by robot, from the enabled map version; if it has none, from the newest version that has
  // some.
  std::map<std::string, std::shared_ptr<const Trajectory>> smoothed;
};

}  // namespace cairn::server
