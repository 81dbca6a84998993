// A tile of the map as a picture for the page: in the colours of a theme, unknown cells transparent, the highest row
// first. Stateless, thread-safe.
#pragma once

#include <string>

#include "common/map/tile.h"
#include "common/status.h"

namespace cairn::web {

enum class Theme { kLight, kDark };

// The bytes of a PNG. Fails where the tile's bytes are damaged.
[[nodiscard]] Result<std::string> DrawTile(const Tile& tile, Theme theme);

}  // namespace cairn::web
