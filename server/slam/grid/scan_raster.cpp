#include "server/slam/grid/scan_raster.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>

#include "common/geometry/transform2.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

static_assert(ScanRaster::kPiece == 2 * sizeof(std::uint64_t));

int CellAlong(double coordinate_m, double resolution_m) {
  constexpr double kFarthest = 1e9;
  return static_cast<int>(std::clamp(std::floor(coordinate_m / resolution_m), -kFarthest, kFarthest));
}

int RoundDown(int value, int step) {
  const int rest = value % step;
  return value - (rest < 0 ? rest + step : rest);
}

}  // namespace

GridCell CellOf(const Eigen::Vector2d& p_map, double resolution_m) {
  return {CellAlong(p_map.x(), resolution_m), CellAlong(p_map.y(), resolution_m)};
}

void ScanRaster::MarkAll(const Scan& scan, const Pose2& T_map_robot, const RasterOptions& options) {
  const Pose2 T_map_laser = T_map_robot * scan.T_robot_laser;
  const GridCell from = CellOf(T_map_laser.translation(), options.resolution_m);
  FindRays(scan, T_map_laser, options);
  GridCell high = from;
  low_ = from;
  for (const Ray& ray : rays_) {
    low_ = {std::min(low_.x, ray.to.x), std::min(low_.y, ray.to.y)};
    high = {std::max(high.x, ray.to.x), std::max(high.y, ray.to.y)};
  }
  const double spread_cells = options.hit_spread_m / options.resolution_m;
  const int spread = static_cast<int>(std::ceil(spread_cells));
  low_ = {RoundDown(low_.x - spread, kPiece), low_.y - spread};
  width_ = RoundDown(high.x + spread - low_.x, kPiece) + kPiece;
  height_ = high.y + spread - low_.y + 1;
  const std::size_t cells = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  if (marks_.size() < cells) marks_.resize(cells, kUntouched);
  for (const Ray& ray : rays_) {
    MarkRay(from, ray);
    if (ray.hit && spread_cells > 0.0) MarkAround(ray.to, spread_cells);
  }
}

void ScanRaster::FindRays(const Scan& scan, const Pose2& T_map_laser, const RasterOptions& options) {
  rays_.clear();
  const double cos_tilt = std::cos(scan.tilt_rad);
  const std::span<const Eigen::Vector2d> directions = directions_.Of(scan);
  const Transform2 to_map(T_map_laser);
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
    rays_.push_back({CellOf(to_map * OnGround(range, directions[beam], cos_tilt), options.resolution_m), hit});
  }
}

// A step is taken along the longer axis every time and along the other one where the error demands it, without a branch
// that depends on the direction of the ray.
void ScanRaster::MarkRay(GridCell from, const Ray& ray) {
  const int dx = std::abs(ray.to.x - from.x), dy = std::abs(ray.to.y - from.y);
  const std::ptrdiff_t step_x = from.x < ray.to.x ? 1 : -1, step_y = from.y < ray.to.y ? width_ : -width_;
  std::uint8_t* mark = &MarkOf(from.x, from.y);
  const auto walk = [&](std::ptrdiff_t step, std::ptrdiff_t aside, int length, int width) {
    // The error is that of Bresenham's algorithm in the form that treats all octants alike.
    int error = length - width;
    for (int left = length; left > 0; --left) {
      *mark = static_cast<std::uint8_t>(*mark | (*mark == kUntouched ? kPassed : kUntouched));
      const bool turn = 2 * error <= length;
      error += (turn ? length : 0) - width;
      mark += step + (turn ? aside : 0);
    }
  };
  if (dx >= dy) {
    walk(step_x, step_y, dx, dy);
  } else {
    walk(step_y, step_x, dy, dx);
  }
  std::uint8_t& last = MarkOf(ray.to.x, ray.to.y);
  last = std::max(last, ray.hit ? kHit : kPassed);
}

// The share falls linearly with the distance from the cell that was hit.
void ScanRaster::MarkAround(GridCell hit, double spread_cells) {
  const int reach = static_cast<int>(std::ceil(spread_cells));
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      const double share = 1.0 - std::sqrt(static_cast<double>(dx * dx + dy * dy)) / spread_cells;
      std::uint8_t& mark = MarkOf(hit.x + dx, hit.y + dy);
      if (share > 0.0) mark = std::max(mark, static_cast<std::uint8_t>(kPassed + share * (kHit - kPassed)));
    }
  }
}

}  // namespace cairn::slam
