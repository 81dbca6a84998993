// How what one robot has drawn agrees with what others have drawn at the same place: whether its walls lie where the
// others have seen that there is nothing. For finding out that a robot does not start where somebody says it does.
// Because a start is never exact, the grid is moved by up to kReachM and kReachRad to where it agrees best. Stateless,
// thread-safe.
#pragma once

#include <cstddef>

#include "common/geometry/pose2.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

struct GridAgreement {
  static constexpr double kReachM = 0.6, kReachRad = 0.12;
  static constexpr double kNearM = 0.2;  // From a wall, at most, for being the same wall.

  std::size_t compared = 0;      // Occupied cells of the robot of which the others know something.
  std::size_t contradicted = 0;  // Those of them that are free for the others, with nothing occupied near them.

  [[nodiscard]] double contradicted_share() const {
    return compared == 0 ? 0.0 : static_cast<double>(contradicted) / static_cast<double>(compared);
  }
  // Whether so much was compared that it tells something.
  [[nodiscard]] bool known() const {
    constexpr std::size_t kEnough = 100;
    return compared >= kEnough;
  }
  // Whether the robot must be elsewhere. What people and furniture leave is less than this (cairn-study starts).
  [[nodiscard]] bool Contradicts() const {
    constexpr double kShare = 0.33;
    return known() && contradicted_share() >= kShare;
  }
};

// Both grids in one frame, with cells of the same size. `grid` is turned around `centre`, where its robot is.
[[nodiscard]] GridAgreement CompareGrids(const slam::OccupancyGrid::Chunks& grid,
                                         const slam::OccupancyGrid::Chunks& others, const Pose2& centre,
                                         double resolution_m);

}  // namespace cairn::server
