// Converts the occupancy grid to one image with its pose in the map frame. Stateless, thread-safe.
#pragma once

#include "common/map/occupancy_image.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::slam {

// The image covers the bounding box of all chunks. It is 0 x 0 for an empty grid.
[[nodiscard]] OccupancyImage ImageOf(const OccupancyGrid& grid);

}  // namespace cairn::slam
