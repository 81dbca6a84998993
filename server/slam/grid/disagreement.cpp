#include "server/slam/grid/disagreement.h"

#include <algorithm>
#include <cmath>

#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

constexpr std::uint8_t kOccupiedFrom = 50;  // Percent; a cell above this counts as occupied.

bool Occupied(const OccupancyGrid& grid, const Eigen::Vector2d& p_map) {
  const std::uint8_t cell = grid.OccupancyAt(p_map);
  return cell != kUnknownCell && cell > kOccupiedFrom;
}

// Searches rings of cells outwards. Most beams end in an occupied cell, and then the search ends at once.
double NearestSquared(const OccupancyGrid& grid, const Eigen::Vector2d& p_map, double max_distance_m) {
  if (Occupied(grid, p_map)) return 0.0;
  const double cell_m = grid.options().resolution_m;
  const int rings = static_cast<int>(std::ceil(max_distance_m / cell_m));
  double best_m2 = max_distance_m * max_distance_m;
  for (int ring = 1; ring <= rings && ring * ring * cell_m * cell_m <= best_m2; ++ring) {
    for (int i = -ring; i <= ring; ++i) {
      for (const auto& [dx, dy] : {std::pair{i, -ring}, {i, ring}, {-ring, i}, {ring, i}}) {
        const double distance_m2 = (dx * dx + dy * dy) * cell_m * cell_m;
        if (distance_m2 < best_m2 && Occupied(grid, p_map + cell_m * Eigen::Vector2d(dx, dy))) best_m2 = distance_m2;
      }
    }
  }
  return best_m2;
}

}  // namespace

void Disagreement::Add(const Scan& scan, const Pose2& T_map_robot, const OccupancyGrid& grid) {
  const Pose2 T_map_laser = T_map_robot * scan.T_robot_laser;
  const double reach_m = grid.options().max_ray_m;  // Hits farther away were not drawn into the grid.
  const double cos_tilt = std::cos(scan.tilt_rad);
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const float range_m = scan.ranges_m[i];
    if (ClassifyRange(range_m, scan.range_min_m, scan.range_max_m) != BeamClass::kHit || range_m > reach_m) continue;
    const double bearing = scan.angle_first_rad + static_cast<double>(i) * scan.angle_step_rad;
    const Eigen::Vector2d p_laser = OnGround(range_m, bearing, cos_tilt);
    sum_m2_ += NearestSquared(grid, T_map_laser * p_laser, kMaxDistanceM);
    ++beams_;
  }
}

void Disagreement::Add(const Disagreement& other) {
  sum_m2_ += other.sum_m2_;
  beams_ += other.beams_;
}

}  // namespace cairn::slam
