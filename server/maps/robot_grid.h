// The values that a site's map and the sessions that draw it exchange, and the interface through which a site
// calls a session (GridOwner). Chunks are shared, immutable, and in the map frame.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

using SessionId = std::uint64_t;  // Unique while the server runs; later sessions have larger ids.

// Where keyframes of a robot lie in its grid: T_map_robot, by the numbers of the keyframes, which increase.
struct DrawnPath {
  std::shared_ptr<const std::vector<Pose2>> path;  // Null: not known.
  // One for each pose. Null: 0, 1, 2, ...
  std::shared_ptr<const std::vector<std::uint64_t>> numbers;

  // Null: it has no such keyframe.
  [[nodiscard]] const Pose2* Find(std::uint64_t number) const {
    if (path == nullptr) return nullptr;
    std::size_t index = number;
    if (numbers != nullptr) {
      const auto found = std::ranges::lower_bound(*numbers, number);
      if (found == numbers->end() || *found != number) return nullptr;
      index = static_cast<std::size_t>(found - numbers->begin());
    }
    return index < path->size() ? &(*path)[index] : nullptr;
  }
};

// A robot's grid, drawn when there had been so many keyframes.
struct RobotGrid {
  slam::OccupancyGrid::Chunks chunks;
  std::uint64_t keyframes = 0;
  // T_map_robot of the keyframes in this grid. The estimator's path follows it (slam::Mapper::AdoptGrid). Null: it is
  // not known, and the path stays.
  std::shared_ptr<const std::vector<Pose2>> path{};
  // The numbers of the keyframes of the path, because some may have been retired. Null: all of them, 0, 1, 2, ...
  std::shared_ptr<const std::vector<std::uint64_t>> numbers{};
  // T_map_robot at which these keyframes are drawn in the grid, where that is not along the path: a filter may have
  // come to believe in another hypothesis since. Null: along the path.
  std::shared_ptr<const std::vector<Pose2>> drawn{};
  // Whether it is not joined with the map of the site: it has a frame of its own and is not shown.
  bool fragment = false;
};

// The changed chunks of one session's grid (null: removed).
struct GridChange {
  SessionId session = 0;
  slam::OccupancyGrid::Change chunks;
  DrawnPath drawn{};  // Of the keyframes that are drawn, where they lie after the change.
  // The cells at which the robot has looked since the change before. Cells that were drawn again are not among them.
  slam::OccupancyGrid::Looks looks{};
};

// A session's answer to a correction: its previous grid, and the change to the grid with which it continues.
struct Adopted {
  SessionId session = 0;
  RobotGrid displaced;
  GridChange change;  // Contains every chunk of both grids.
  bool fragment =
      false;  // It is not joined with the map of the site, as RobotGrid says or because it could not follow.
};

// The grid with which a session is to continue, from a finished job or an older map version. It is valid from
// map epoch `epoch` on. `done` is called once, on any thread. It is never called if the session drops the
// correction without adopting it.
struct Correction {
  std::uint32_t epoch = 0;
  std::uint64_t generation = 0;  // Start of the server that switches the map.
  RobotGrid grid;
  std::function<void(Adopted&&)> done;
  // Becomes true when all sessions have adopted their parts and this was handed to the journal. If the server ends
  // before, nothing has been switched: until then no checkpoint may hold the new grid. Null: true from the beginning.
  std::shared_ptr<const std::atomic<bool>> completed{};
};

// The interface of a session for its site. Thread rule: any thread; must not block.
class GridOwner {
 public:
  virtual ~GridOwner() = default;
  virtual void Adopt(Correction&& correction) = 0;
  // The map is in this epoch now. A version that was made from older data has no part for this session: its grid and
  // its path stay as they are.
  virtual void SetMapEpoch(std::uint32_t epoch) = 0;
};

}  // namespace cairn::server
