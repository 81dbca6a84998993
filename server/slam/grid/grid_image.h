// The occupancy grid as one image with its place in the map frame. Stateless, thread-safe.
#pragma once

#include "common/map/occupancy_image.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::slam {

// The bounding box of all chunks; 0 x 0 for an empty grid.
[[nodiscard]] OccupancyImage ImageOf(const OccupancyGrid& grid);

}  // namespace cairn::slam
