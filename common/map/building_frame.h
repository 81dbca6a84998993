// The frame of a building: where people want the origin and the axes of the maps and poses that they look at. It is an
// edit of the map (MapEditKind::kOrigin), so it stays where robots draw the map anew; robots, tiles and queries go on
// in the frame `map`. Stateless functions; thread-safe.
#pragma once

#include <optional>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/map/map_edit.h"
#include "common/map/occupancy_image.h"

namespace cairn {

// T_map_building, as the last edit of the kind kOrigin says. Nothing: there is none.
[[nodiscard]] std::optional<Pose2> BuildingFrameOf(const std::vector<MapEdit>& edits);

// The same map in another frame: its `T_map_origin` is then the place of the lower-left corner in that frame, without a
// rotation. Cells are copied where the frames are parallel. Otherwise the image is turned, so that it may have twice as
// many cells, and a wall can become up to a cell thicker, but gets no gaps.
[[nodiscard]] OccupancyImage InFrame(const OccupancyImage& map, const Pose2& T_map_frame);

// The direction of most walls in the frame of the image, in (-pi/4, pi/4]: by how much a frame along the walls is
// turned. FAILED_PRECONDITION: too little is occupied, or no direction stands out.
[[nodiscard]] Result<double> WallDirection(const OccupancyImage& map);

}  // namespace cairn
