#include "server/slam/known_grid/known_grid.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::slam {
namespace {

// Percent. Between the two a cell counts as neither.
constexpr int kOccupied = 65;
constexpr int kFree = 35;
constexpr int kAround = 2;          // Cells to either side that show the direction of a surface, ...
constexpr int kNear = 1;            // ... and its position across.
constexpr double kFlatness = 0.25;  // Variance across, over that along, up to which a surface has a direction.
constexpr double kSquareM = 2.0;    // Side of the squares by which surfaces are found.

// The occupied cells around a cell, with weights.
struct Blob {
  double weight = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();

  void Add(const Eigen::Vector2d& d, double w) {
    weight += w;
    sum += w * d;
    squares += w * d * d.transpose();
  }
  [[nodiscard]] Eigen::Vector2d mean() const { return sum / weight; }
  [[nodiscard]] Eigen::Matrix2d covariance() const { return squares / weight - mean() * mean().transpose(); }
};

}  // namespace

bool KnownGrid::IsBounded(const Source& source) {
  if (!(source.resolution_m >= 0.01 && source.resolution_m <= 1.0)) return false;
  if (source.tiles.empty()) return true;
  constexpr std::int64_t kMostTiles = 1 << 20;  // From the origin.
  std::int64_t low_x = kMostTiles, high_x = -kMostTiles, low_y = kMostTiles, high_y = -kMostTiles;
  for (const auto& [key, cells] : source.tiles) {
    low_x = std::min<std::int64_t>(low_x, key.x);
    high_x = std::max<std::int64_t>(high_x, key.x);
    low_y = std::min<std::int64_t>(low_y, key.y);
    high_y = std::max<std::int64_t>(high_y, key.y);
  }
  const double side_m = source.resolution_m * kTileCells;
  return std::min(low_x, low_y) > -kMostTiles && std::max(high_x, high_y) < kMostTiles &&
         static_cast<double>(std::max(high_x - low_x, high_y - low_y) + 1) * side_m <= kMostM;
}

KnownGrid::KnownGrid(Source source, const PlaceSearchOptions& options, double near_m)
    : source_(std::move(source)), cell_scale_(options.cell_scale), near_m_(near_m) {
  std::vector<SurfacePoint> surfaces;
  for (const auto& [key, cells] : source_.tiles) {
    for (int i = 0; i < kTileArea; ++i) {
      const std::uint8_t cell = (*cells)[static_cast<std::size_t>(i)];
      if (cell != kUnknownCell && cell >= kOccupied)
        AddSurfacesAt(key.x * kTileCells + i % kTileCells, key.y * kTileCells + i / kTileCells, surfaces);
    }
  }
  for (const SurfacePoint& surface : surfaces) {
    const Eigen::Vector2d square = (surface.p / kSquareM).array().floor();
    squares_[{static_cast<int>(square.x()), static_cast<int>(square.y())}].push_back(surface);
  }
  index_ = std::make_shared<const IndexedSurfaces>(std::move(surfaces), options.cell_scale);
}

bool KnownGrid::IsMadeOf(const Source& source, double cell_scale, double near_m) const {
  return source.epoch == source_.epoch && source.resolution_m == source_.resolution_m && cell_scale == cell_scale_ &&
         near_m == near_m_ && std::ranges::equal(source.tiles, source_.tiles, [](const auto& a, const auto& b) {
           return a.first == b.first && (a.second == b.second || *a.second == *b.second);
         });
}

bool KnownGrid::IsOf(const Source& source, const PlaceSearchOptions& options, double near_m) const {
  return IsMadeOf(source, options.cell_scale, near_m);
}

bool KnownGrid::IsSameAs(const KnownGrid& other) const {
  return IsMadeOf(other.source_, other.cell_scale_, other.near_m_);
}

std::uint8_t KnownGrid::Cell(int x, int y) const {
  const auto tile = source_.tiles.find({FloorDiv(x, kTileCells), FloorDiv(y, kTileCells)});
  if (tile == source_.tiles.end()) return kUnknownCell;
  const int column = x - tile->first.x * kTileCells, row = y - tile->first.y * kTileCells;
  return (*tile->second)[static_cast<std::size_t>(row * kTileCells + column)];
}

int KnownGrid::CellOf(double coordinate_m) const {
  return static_cast<int>(std::floor(coordinate_m / source_.resolution_m));
}

std::uint8_t KnownGrid::At(const Eigen::Vector2d& p_map) const {
  return Cell(CellOf(p_map.x()), CellOf(p_map.y()));
}

// The surfaces of an occupied cell: none inside of something thick.
void KnownGrid::AddSurfacesAt(int x, int y, std::vector<SurfacePoint>& surfaces) const {
  Blob around, near;
  std::vector<Eigen::Vector2d> free;
  for (int dy = -kAround; dy <= kAround; ++dy) {
    for (int dx = -kAround; dx <= kAround; ++dx) {
      const std::uint8_t cell = Cell(x + dx, y + dy);
      if (cell == kUnknownCell) continue;
      const Eigen::Vector2d d(dx, dy);
      if (cell <= kFree) free.push_back(d);
      if (cell <= 50) continue;
      const double weight = (cell - 50) / 50.0;
      around.Add(d, weight);
      if (std::abs(dx) <= kNear && std::abs(dy) <= kNear) near.Add(d, weight);
    }
  }
  if (free.empty()) return;
  const Eigen::Vector2d centre = source_.resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(around.covariance());
  const double across = axes.eigenvalues().x(), along = axes.eigenvalues().y();
  if (along <= 0.0 || across > kFlatness * along) {
    surfaces.push_back({centre, Eigen::Vector2d::Zero()});
    return;
  }
  const Eigen::Vector2d normal = axes.eigenvectors().col(0);
  const Eigen::Vector2d p = centre + source_.resolution_m * near.mean().dot(normal) * normal;
  for (const double side : {1.0, -1.0}) {
    const auto lies_there = [&](const Eigen::Vector2d& d) { return side * (d - near.mean()).dot(normal) > 0.5; };
    if (std::any_of(free.begin(), free.end(), lies_there)) surfaces.push_back({p, side * normal});
  }
}

std::vector<SurfacePoint> KnownGrid::SurfacesNear(const Eigen::Vector2d& p_map, double distance_m) const {
  std::vector<SurfacePoint> near;
  const Eigen::Vector2d low = ((p_map.array() - distance_m) / kSquareM).floor();
  const Eigen::Vector2d high = ((p_map.array() + distance_m) / kSquareM).floor();
  for (int y = static_cast<int>(low.y()); y <= static_cast<int>(high.y()); ++y) {
    for (int x = static_cast<int>(low.x()); x <= static_cast<int>(high.x()); ++x) {
      if (const auto square = squares_.find({x, y}); square != squares_.end())
        near.insert(near.end(), square->second.begin(), square->second.end());
    }
  }
  return near;
}

VisibilityCounts KnownGrid::Compare(const Scan& scan, const std::vector<SurfacePoint>& points_robot,
                                    const Pose2& T_map_robot) const {
  const std::vector<SurfacePoint> surfaces = SurfacesNear(T_map_robot.translation(), kMaxVisibleM);
  VisibilityCounts counts = CompareVisibility(scan, T_map_robot.Inverse(), surfaces, near_m_, kMaxVisibleM);
  counts += ComparePoints(points_robot, T_map_robot, kMaxVisibleM);
  return counts;
}

VisibilityCounts KnownGrid::ComparePoints(const std::vector<SurfacePoint>& points_robot, const Pose2& T_map_robot,
                                          double max_range_m) const {
  VisibilityCounts counts;
  for (const SurfacePoint& point : points_robot) {
    if (point.p.norm() > max_range_m) continue;
    const Eigen::Vector2d p = T_map_robot * point.p;
    if (index_->index.Nearest(p, near_m_) != nullptr) {
      ++counts.confirmed;
    } else if (const std::uint8_t cell = At(p); cell != kUnknownCell && cell <= kFree) {
      ++counts.contradicted;
    }
  }
  return counts;
}

}  // namespace cairn::slam
