#include "tests/studies/correction/told_places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "server/slam/scan/beam_points.h"

namespace cairn::studies {
namespace {

constexpr std::uint8_t kOccupied = 65;  // As Nav2 takes it.
constexpr std::size_t kFewBeams = 50;   // Fewer say nothing about a place.
constexpr double kClearly = 0.05;       // Share of the beams.

struct Cells {
  std::vector<int> x, y;
};

Cells CellsOf(const OccupancyImage& map, const Scan& scan, const Pose2& T_map_robot) {
  const Pose2 T_origin_robot = Between(map.T_map_origin, T_map_robot);
  const std::vector<slam::BeamPoint> points = slam::PointsOf(scan);
  Cells cells;
  cells.x.reserve(points.size());
  cells.y.reserve(points.size());
  for (const slam::BeamPoint& point : points) {
    const Eigen::Vector2d p = T_origin_robot * point.p_robot / map.resolution_m;
    cells.x.push_back(static_cast<int>(std::floor(p.x())));
    cells.y.push_back(static_cast<int>(std::floor(p.y())));
  }
  return cells;
}

std::size_t OnWalls(const OccupancyImage& map, const Cells& cells, int dx, int dy) {
  std::size_t on = 0;
  for (std::size_t i = 0; i < cells.x.size(); ++i) {
    const int x = cells.x[i] + dx, y = cells.y[i] + dy;
    if (x < 0 || y < 0 || x >= map.width || y >= map.height) continue;
    const std::uint8_t cell =
        map.cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) + static_cast<std::size_t>(x)];
    on += cell >= kOccupied && cell <= 100 ? 1 : 0;
  }
  return on;
}

}  // namespace

double MoveOnto(const OccupancyImage& map, const Scan& scan, const Pose2& T_map_robot, double most_m) {
  const Cells cells = CellsOf(map, scan, T_map_robot);
  if (cells.x.size() < kFewBeams) return 0.0;
  const int reach = static_cast<int>(std::lround(most_m / map.resolution_m));
  struct Move {
    int squared = 0;
    std::size_t on = 0;
  };
  std::vector<Move> moves;
  moves.reserve(static_cast<std::size_t>((2 * reach + 1) * (2 * reach + 1)));
  std::size_t most_on = 0;
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      moves.push_back({dx * dx + dy * dy, OnWalls(map, cells, dx, dy)});
      most_on = std::max(most_on, moves.back().on);
    }
  }
  const double enough = static_cast<double>(most_on) - kClearly * static_cast<double>(cells.x.size());
  int shortest = 2 * reach * reach;
  for (const Move& move : moves)
    if (static_cast<double>(move.on) >= enough) shortest = std::min(shortest, move.squared);
  return map.resolution_m * std::sqrt(static_cast<double>(shortest));
}

double LargestMove(const OccupancyImage& map, std::span<const SeenFrom> scans, double most_m) {
  double largest_m = 0.0;
  for (const SeenFrom& one : scans) largest_m = std::max(largest_m, MoveOnto(map, *one.scan, one.T_map_robot, most_m));
  return largest_m;
}

}  // namespace cairn::studies
