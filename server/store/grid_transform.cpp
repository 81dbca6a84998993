#include "server/store/grid_transform.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "common/map/tile.h"

namespace cairn::server {
namespace {

constexpr std::int16_t kUnseen = INT16_MIN;  // As in the estimator's grid: no ray has passed the cell.

using Place = std::pair<int, int>;
using Cells = std::array<std::int16_t, static_cast<std::size_t>(kTileArea)>;

// The chunks of the result that a chunk of the source may touch: those around its corners.
void AddTouched(const Place& chunk, const Pose2& T_to_from, double side_m, std::set<Place>& touched) {
  int low_x = INT32_MAX, low_y = INT32_MAX, high_x = INT32_MIN, high_y = INT32_MIN;
  for (int corner = 0; corner < 4; ++corner) {
    const Eigen::Vector2d p_from(side_m * (chunk.first + corner % 2), side_m * (chunk.second + (corner < 2 ? 0 : 1)));
    const Eigen::Vector2d p_to = T_to_from * p_from / side_m;
    low_x = std::min(low_x, static_cast<int>(std::floor(p_to.x())));
    low_y = std::min(low_y, static_cast<int>(std::floor(p_to.y())));
    high_x = std::max(high_x, static_cast<int>(std::floor(p_to.x())));
    high_y = std::max(high_y, static_cast<int>(std::floor(p_to.y())));
  }
  for (int y = low_y; y <= high_y; ++y) {
    for (int x = low_x; x <= high_x; ++x) touched.insert({x, y});
  }
}

}  // namespace

StoredGrid Transformed(const StoredGrid& grid, const Pose2& T_to_from, double resolution_m) {
  const double side_m = resolution_m * kTileCells;
  std::map<Place, const std::int16_t*> from;
  std::set<Place> touched;
  for (const StoredChunk& chunk : grid.chunks) {
    from.emplace(Place{chunk.x, chunk.y}, chunk.cells.get());
    AddTouched({chunk.x, chunk.y}, T_to_from, side_m, touched);
  }
  const Pose2 T_from_to = T_to_from.Inverse();
  StoredGrid result{
      .keyframes = grid.keyframes, .chunks = {}, .path = {}, .numbers = grid.numbers, .fragment = grid.fragment};
  const auto moved = [&T_to_from](const std::shared_ptr<const std::vector<Pose2>>& poses) {
    if (poses == nullptr) return poses;
    std::vector<Pose2> there;
    for (const Pose2& pose : *poses) there.push_back(T_to_from * pose);
    return std::make_shared<const std::vector<Pose2>>(std::move(there));
  };
  result.path = moved(grid.path);
  result.drawn = moved(grid.drawn);
  for (const Place& place : touched) {
    auto cells = std::make_shared<Cells>();
    bool seen = false;
    for (int i = 0; i < kTileArea; ++i) {
      const int column = i % kTileCells, row = i / kTileCells;
      const Eigen::Vector2d cell_to(place.first * kTileCells + column + 0.5, place.second * kTileCells + row + 0.5);
      const Eigen::Vector2d cell_from = T_from_to * (cell_to * resolution_m) / resolution_m;
      const int x = static_cast<int>(std::floor(cell_from.x())), y = static_cast<int>(std::floor(cell_from.y()));
      const auto source = from.find({FloorDiv(x, kTileCells), FloorDiv(y, kTileCells)});
      const int inside =
          (y - kTileCells * FloorDiv(y, kTileCells)) * kTileCells + x - kTileCells * FloorDiv(x, kTileCells);
      const std::int16_t value = source == from.end() ? kUnseen : source->second[inside];
      (*cells)[static_cast<std::size_t>(i)] = value;
      seen = seen || value != kUnseen;
    }
    if (!seen) continue;
    const std::int16_t* const first = cells->data();
    result.chunks.push_back({place.first, place.second, std::shared_ptr<const std::int16_t>(std::move(cells), first)});
  }
  return result;
}

std::shared_ptr<const Trajectory> Transformed(const Trajectory& path_from, const Pose2& T_to_from) {
  auto path = std::make_shared<Trajectory>();
  for (const StampedPose& pose : path_from) path->push_back({pose.stamp, T_to_from * pose.T_map_robot});
  return path;
}

}  // namespace cairn::server
