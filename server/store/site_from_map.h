// A site whose map comes from a file, for example of Nav2, and not from robots. Stateless, thread-safe.
#pragma once

#include <map>
#include <string>

#include "common/map/tile.h"
#include "server/store/store.h"

namespace cairn::server {

// Adds a site to a store that holds none. Its map is what an earlier session has drawn, so robots are localised in it,
// and what they see there counts more once they map. `cells`: tiles of level 0 with cells of `resolution_m`. Errors of
// the store. INVALID_ARGUMENT: no valid name.
[[nodiscard]] Result<void> AddSiteFromMap(Store& store, const std::string& site,
                                          const std::map<TileKey, TileCells>& cells, double resolution_m);

}  // namespace cairn::server
