// The published map of a site at one moment. It is immutable and may be read on any thread. Successive
// snapshots share the tiles that did not change.
#pragma once

#include <memory>
#include <vector>

#include "common/map/map_edit.h"
#include "common/service/map_info.h"
#include "server/maps/tile_set.h"
#include "server/store/records.h"

namespace cairn::server {

struct MapSnapshot {
  MapInfo info;
  TileSet tiles;         // All levels.
  TileSet disagreement;  // The same of how much the sessions differ (layer_disagreement.h), while somebody asks for it.
  // Those of the enabled map version; if it has none, those of the newest version that has some.
  SmoothedPaths smoothed;
  std::shared_ptr<const std::vector<MapEdit>> edits = std::make_shared<std::vector<MapEdit>>();
  bool drawn = false;  // Robots have drawn some of it: it does not consist of edits alone.
};

}  // namespace cairn::server
