#include "common/map/map_tiles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "common/map/raster_image.h"

namespace cairn {
namespace {

constexpr double kFarthestMap_m = 1e5;  // From the origin of the map.
constexpr double kSmallestCell_m = 0.001, kLargestCell_m = 10.0;
constexpr double kMostCellsInOne = 32.0;  // Cells of the file along the side of a cell of the tiles.

bool IsCellSize(double side_m) {
  return std::isfinite(side_m) && side_m >= kSmallestCell_m && side_m <= kLargestCell_m;
}

// The places of its tiles.
struct TileRange {
  int x_first = 0, y_first = 0, x_last = 0, y_last = 0;  // Inclusive.
};

Result<TileRange> RangeOf(const OccupancyImage& map, double resolution_m) {
  const auto refuse = [](StatusCode code, const std::string& why) { return Fail(code, why); };
  if (map.width <= 0 || map.height <= 0) return refuse(StatusCode::kInvalidArgument, "the map is empty");
  if (map.cells.size() != static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height))
    return refuse(StatusCode::kInvalidArgument, "the map's cells do not fill its width and height");
  if (!IsCellSize(map.resolution_m) || !IsCellSize(resolution_m))
    return refuse(StatusCode::kInvalidArgument, "the side of a cell must be from 0.001 to 10 m");
  if (resolution_m > kMostCellsInOne * map.resolution_m)
    return refuse(StatusCode::kInvalidArgument, "the cells of the map are less than 1/32 of those that are wanted");
  if (!map.T_map_origin.IsFinite()) return refuse(StatusCode::kInvalidArgument, "the map's origin is not finite");
  Eigen::AlignedBox2d box;
  for (const double x : {0.0, map.width * map.resolution_m}) {
    for (const double y : {0.0, map.height * map.resolution_m}) box.extend(map.T_map_origin * Eigen::Vector2d(x, y));
  }
  if (box.min().minCoeff() < -kFarthestMap_m || box.max().maxCoeff() > kFarthestMap_m)
    return refuse(StatusCode::kOutOfRange, "the map lies more than 100 km from its origin");
  if ((box.sizes() / resolution_m).prod() > static_cast<double>(kMaxImagePixels))
    return refuse(StatusCode::kResourceExhausted, "the map would have too many cells");
  const double tile_m = resolution_m * kTileCells;
  const auto tile_of = [tile_m](double p_m) { return static_cast<int>(std::floor(p_m / tile_m)); };
  const TileRange range{tile_of(box.min().x()), tile_of(box.min().y()), tile_of(box.max().x()), tile_of(box.max().y())};
  if ((std::max(range.x_last - range.x_first, range.y_last - range.y_first) + 1) * tile_m > kMostMapSide_m)
    return refuse(StatusCode::kOutOfRange, "the map is larger than 1000 m, so that no robot could be found in it");
  return range;
}

// What a point of the map frame says, counted in cells of the file from its lower left corner.
class Sampler {
 public:
  Sampler(const OccupancyImage& map, double resolution_m)
      : map_(map),
        count_(std::max(1, static_cast<int>(std::ceil(resolution_m / map.resolution_m - 1e-6)))),
        step_(resolution_m / map.resolution_m) {
    const Pose2 T_origin_map = map.T_map_origin.Inverse();
    origin_ = T_origin_map * Eigen::Vector2d(0, 0) / map.resolution_m;
    along_x_ = (T_origin_map * Eigen::Vector2d(1, 0) - T_origin_map * Eigen::Vector2d(0, 0)) * step_;
    along_y_ = (T_origin_map * Eigen::Vector2d(0, 1) - T_origin_map * Eigen::Vector2d(0, 0)) * step_;
  }

  // `x`, `y`: a cell of the tiles, counted from the origin of the map frame.
  [[nodiscard]] std::uint8_t CellAt(double x, double y) const {
    std::uint8_t largest = kUnknownCell;
    for (int i = 0; i < count_ * count_; ++i) {
      const int column = i % count_, row = i / count_;
      const Eigen::Vector2d p =
          origin_ + (x + (column + 0.5) / count_) * along_x_ + (y + (row + 0.5) / count_) * along_y_;
      const std::uint8_t cell = At(p);
      if (cell != kUnknownCell && (largest == kUnknownCell || cell > largest)) largest = cell;
    }
    return largest;
  }

 private:
  [[nodiscard]] std::uint8_t At(const Eigen::Vector2d& p) const {
    if (!(p.x() >= 0.0 && p.y() >= 0.0 && p.x() < map_.width && p.y() < map_.height)) return kUnknownCell;
    return map_.cells[static_cast<std::size_t>(p.y()) * static_cast<std::size_t>(map_.width) +
                      static_cast<std::size_t>(p.x())];
  }

  const OccupancyImage& map_;
  const int count_;  // Samples along each side of a cell.
  const double step_;
  Eigen::Vector2d origin_, along_x_, along_y_;
};

}  // namespace

Result<std::map<TileKey, TileCells>> ResampleToTiles(const OccupancyImage& map, double resolution_m) {
  const auto range = RangeOf(map, resolution_m);
  if (!range) return tl::unexpected(range.error());
  const Sampler sampler(map, resolution_m);
  std::map<TileKey, TileCells> tiles;
  for (int tile_y = range->y_first; tile_y <= range->y_last; ++tile_y) {
    for (int tile_x = range->x_first; tile_x <= range->x_last; ++tile_x) {
      TileCells cells{};
      bool known = false;
      for (int i = 0; i < kTileArea; ++i) {
        const int column = tile_x * kTileCells + i % kTileCells, row = tile_y * kTileCells + i / kTileCells;
        const std::uint8_t cell = sampler.CellAt(column, row);
        cells[static_cast<std::size_t>(i)] = cell;
        known = known || cell != kUnknownCell;
      }
      if (known) tiles.emplace(TileKey{0, tile_x, tile_y}, cells);
    }
  }
  if (tiles.empty()) return Fail(StatusCode::kInvalidArgument, "nothing is known in the map");
  return tiles;
}

}  // namespace cairn
