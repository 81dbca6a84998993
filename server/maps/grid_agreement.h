// How what one robot has drawn agrees with what others have drawn at the same place: whether its walls lie where the
// others have seen that there is nothing, or theirs where it has, as if it had driven through them. For finding out
// that a robot does not start where somebody says it does. Because a start is never exact, the grid is moved by up to
// kReachM and kReachRad to where it agrees best. Stateless, thread-safe.
#pragma once

#include <cstddef>

#include "common/geometry/pose2.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

struct GridAgreement {
  static constexpr double kReachM = 0.6, kReachRad = 0.12;
  static constexpr double kNearM = 0.2;  // From a wall, at most, for being the same wall.

  // Occupied cells of each of the two of which the other knows something, and those of them that are free for the
  // other, with nothing occupied near them.
  std::size_t compared = 0;
  std::size_t contradicted = 0;

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

// Both grids in one frame, with cells of the same size. `grid` is turned around `start`, where its robot has begun: an
// error of its heading there moves what it sees some metres on by more than kReachM.
[[nodiscard]] GridAgreement CompareGrids(const slam::OccupancyGrid::Chunks& grid,
                                         const slam::OccupancyGrid::Chunks& others, const Pose2& start,
                                         double resolution_m);

}  // namespace cairn::server
