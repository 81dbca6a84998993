#include "server/slam/dpslam/change_painter.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "server/slam/dpslam/ray_walk.h"

namespace cairn::slam {

void ChangePainter::Draw(const LaserRays& rays, const Pose2& T_map_robot) {
  const double c = std::cos(T_map_robot.theta), s = std::sin(T_map_robot.theta);
  const Eigen::Vector2d origin = (T_map_robot * rays.origin_robot) / resolution_m_;
  ChangeTileKey at{INT32_MIN, INT32_MIN};
  Sheet* sheet = nullptr;
  const auto cell_of = [&](int x, int y) {
    const ChangeTileKey key{y >> kTileBits, x >> kTileBits};
    if (key != at) sheet = &SheetAt(at = key);
    return static_cast<std::size_t>(((y & (kChangeTileSide - 1)) << kTileBits) | (x & (kChangeTileSide - 1)));
  };
  for (const LaserRay& ray : rays.rays) {
    const Eigen::Vector2d along(c * ray.direction.x() - s * ray.direction.y(),
                                s * ray.direction.x() + c * ray.direction.y());
    std::size_t cell = 0;
    WalkRay(origin, along, ray.length_m / resolution_m_, [&](int x, int y, double from, double to) {
      cell = cell_of(x, y);
      sheet->travel[cell] += static_cast<float>(to - from);
      sheet->touched[cell >> kTileBits] |= std::uint64_t{1} << (cell & (kChangeTileSide - 1));
    });
    if (ray.hit) ++sheet->stops[cell];
  }
}

MapChanges ChangePainter::Take() {
  MapChanges changes;
  for (auto& [key, sheet] : sheets_) {
    std::size_t count = 0;
    for (const std::uint64_t row : sheet->touched) count += static_cast<std::size_t>(std::popcount(row));
    ChangeTile tile;
    tile.key = key;
    tile.list.reserve(count);
    for (std::size_t row = 0; row < sheet->touched.size(); ++row) {
      for (std::uint64_t bits = sheet->touched[row]; bits != 0; bits &= bits - 1) {
        const std::size_t cell = (row << kTileBits) + static_cast<std::size_t>(std::countr_zero(bits));
        double travel = std::round(static_cast<double>(sheet->travel[cell]) * kTravelPerCell);
        double stops = sheet->stops[cell];
        const double shrink = std::max({1.0, travel / UINT16_MAX, stops / UINT16_MAX});
        travel = std::floor(travel / shrink), stops = std::floor(stops / shrink);
        if (travel > 0.0 || stops > 0.0)
          tile.list.push_back({static_cast<std::uint16_t>(cell), static_cast<std::uint16_t>(travel),
                               static_cast<std::uint16_t>(stops)});
        sheet->travel[cell] = 0.0F;
        sheet->stops[cell] = 0;
      }
      sheet->touched[row] = 0;
    }
    blank_.push_back(std::move(sheet));
    if (!tile.list.empty()) changes.Append(std::move(tile));
  }
  sheets_.clear();
  return changes;
}

ChangePainter::Sheet& ChangePainter::SheetAt(const ChangeTileKey& key) {
  std::unique_ptr<Sheet>& sheet = sheets_[key];
  if (!sheet && !blank_.empty()) {
    sheet = std::move(blank_.back());
    blank_.pop_back();
  } else if (!sheet) {
    sheet = std::make_unique<Sheet>();
  }
  return *sheet;
}

}  // namespace cairn::slam
