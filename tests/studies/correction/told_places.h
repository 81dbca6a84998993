// Whether the path of a robot agrees with the tiles of the map: how far scans of the path would have to be moved so
// that the walls they see lie on the walls that the tiles show. Frame: map; metres. Stateless, deterministic.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/map/occupancy_image.h"
#include "common/sensor/scan.h"

namespace cairn::studies {

// The shortest move by whole cells, at most `most_m`, with which no other one puts clearly more of the scan's beams on
// occupied cells. Along a corridor many moves are as good, and the shortest one counts. 0 where the scan sees little.
[[nodiscard]] double MoveOnto(const OccupancyImage& map, const Scan& scan, const Pose2& T_map_robot, double most_m);

// The largest of these over scans at these poses, one for each.
struct SeenFrom {
  std::shared_ptr<const Scan> scan;
  Pose2 T_map_robot;
};
[[nodiscard]] double LargestMove(const OccupancyImage& map, std::span<const SeenFrom> scans, double most_m);

}  // namespace cairn::studies
