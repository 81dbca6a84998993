// The published map of a site at one moment. It is immutable and may be read on any thread. Successive
// snapshots share the tiles that did not change.
#pragma once

#include "common/service/map_info.h"
#include "server/maps/tile_set.h"
#include "server/store/records.h"

namespace cairn::server {

struct MapSnapshot {
  MapInfo info;
  TileSet tiles;  // All levels.
  // Those of the enabled map version; if it has none, those of the newest version that has some.
  SmoothedPaths smoothed;
};

}  // namespace cairn::server
