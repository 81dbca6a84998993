// What a person should know of an edit of the map before trusting it. Stateless.
#pragma once

#include <string>

#include "common/map/map_edit.h"
#include "common/service/map_info.h"

namespace cairn::client {

// Of an edit that lies outside of what is drawn in the map, where a wrong frame or sign is likely; otherwise empty.
[[nodiscard]] std::string EditWarning(const MapEdit& edit, const MapInfo& map);

}  // namespace cairn::client
