// Pictures of a map for the page: transparent where there is nothing to show, the highest row first. Stateless,
// thread-safe.
#pragma once

#include <string>

#include "common/map/occupancy_image.h"
#include "common/map/tile.h"
#include "common/status.h"

namespace cairn::web {

enum class Theme { kLight, kDark };

// The bytes of a PNG: a tile in the colours of a theme. Fails where the tile's bytes are damaged.
[[nodiscard]] Result<std::string> DrawTile(const Tile& tile, Theme theme);
// The same of a whole map. REQUIRES: it has at least one cell, and as many as its size says.
[[nodiscard]] Result<std::string> DrawMap(const OccupancyImage& map, Theme theme);
// The bytes of a PNG that shows the cells about which robots differ by more than half (QueryClient::DisagreementImage).
[[nodiscard]] Result<std::string> DrawDisagreement(const OccupancyImage& image);

}  // namespace cairn::web
