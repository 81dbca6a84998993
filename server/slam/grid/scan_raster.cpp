#include "server/slam/grid/scan_raster.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

constexpr std::uint8_t kPassed = 1, kHit = 255;

// A pose may have any finite coordinates. Beyond kFarthest cells, all points fall into the last cell.
int CellAlong(double coordinate_m, double resolution_m) {
  constexpr double kFarthest = 1e9;
  return static_cast<int>(std::clamp(std::floor(coordinate_m / resolution_m), -kFarthest, kFarthest));
}

GridCell CellOf(const Eigen::Vector2d& p_map, double resolution_m) {
  return {CellAlong(p_map.x(), resolution_m), CellAlong(p_map.y(), resolution_m)};
}

}  // namespace

void ScanRaster::Rasterise(const Scan& scan, const Pose2& T_map_robot, const RasterOptions& options,
                           const std::function<void(GridCell, double)>& visit) {
  const Pose2 T_map_laser = T_map_robot * scan.T_robot_laser;
  const GridCell from = CellOf(T_map_laser.translation(), options.resolution_m);
  const double spread_cells = options.hit_spread_m / options.resolution_m;
  const int reach = static_cast<int>(std::ceil(options.max_ray_m / options.resolution_m) + std::ceil(spread_cells)) + 2;
  low_ = {from.x - reach, from.y - reach};
  width_ = height_ = 2 * reach + 1;
  marks_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), 0);

  const double cos_tilt = std::cos(scan.tilt_rad);
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    const BeamClass kind = ClassifyRange(scan.ranges_m[beam], scan.range_min_m, scan.range_max_m);
    if (kind == BeamClass::kInvalid) continue;
    double range = kind == BeamClass::kHit ? static_cast<double>(scan.ranges_m[beam])
                                           : std::min(options.no_return_free_m, scan.range_max_m);
    bool hit = kind == BeamClass::kHit;
    if (range > options.max_ray_m) {
      range = options.max_ray_m;
      hit = false;
    }
    if (range <= 0.0) continue;
    const double bearing = scan.angle_first_rad + static_cast<double>(beam) * scan.angle_step_rad;
    const Eigen::Vector2d end = T_map_laser * OnGround(range, bearing, cos_tilt);
    MarkRay(from, CellOf(end, options.resolution_m), hit);
    if (hit && spread_cells > 0.0) MarkAround(CellOf(end, options.resolution_m), spread_cells);
  }
  for (const std::uint32_t index : touched_) {
    const int x = static_cast<int>(index) % width_, y = static_cast<int>(index) / width_;
    visit({low_.x + x, low_.y + y}, static_cast<double>(marks_[index] - kPassed) / (kHit - kPassed));
    marks_[index] = 0;
  }
  touched_.clear();
}

void ScanRaster::MarkRay(GridCell from, GridCell to, bool hit) {
  const int dx = std::abs(to.x - from.x), dy = -std::abs(to.y - from.y);
  const int step_x = from.x < to.x ? 1 : -1, step_y = from.y < to.y ? 1 : -1;
  int error = dx + dy, x = from.x, y = from.y;
  while (x != to.x || y != to.y) {
    Mark(x, y, kPassed);
    const int twice = 2 * error;
    if (twice >= dy) error += dy, x += step_x;
    if (twice <= dx) error += dx, y += step_y;
  }
  Mark(to.x, to.y, hit ? kHit : kPassed);
}

// The share falls linearly with the distance from the cell that was hit.
void ScanRaster::MarkAround(GridCell hit, double spread_cells) {
  const int reach = static_cast<int>(std::ceil(spread_cells));
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      const double share = 1.0 - std::sqrt(static_cast<double>(dx * dx + dy * dy)) / spread_cells;
      if (share > 0.0) Mark(hit.x + dx, hit.y + dy, static_cast<std::uint8_t>(kPassed + share * (kHit - kPassed)));
    }
  }
}

void ScanRaster::Mark(int x, int y, std::uint8_t mark) {
  const auto index = static_cast<std::uint32_t>((y - low_.y) * width_ + (x - low_.x));
  if (marks_[index] == 0) touched_.push_back(index);
  marks_[index] = std::max(marks_[index], mark);
}

}  // namespace cairn::slam
