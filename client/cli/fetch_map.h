// The whole current map of a site, asked from the server and put together.
#pragma once

#include <string>

#include "client/cli/program.h"
#include "common/map/occupancy_image.h"

namespace cairn::client {

// `map_info` of one site; kNotFound where the server knows none of that name.
[[nodiscard]] Result<MapInfo> FetchMapInfo(Program& program, const std::string& site);
[[nodiscard]] Result<OccupancyImage> FetchMap(Program& program, const std::string& site);

}  // namespace cairn::client
