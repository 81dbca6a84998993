// An occupancy map that somebody has made before, in which a robot finds itself: its surfaces with their directions, to
// align scans with, and its cells, to compare scans with. It never changes.
// A surface lies where an occupied cell has a free one near it, on the line that fits the occupied cells around it
// best; a wall that is free on both sides has a surface on each. Frame: `map`. Immutable: any thread may read. Source:
// none; the alignment is that of point_to_line.h, the comparison that of visibility.h.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "common/map/tile.h"
#include "server/slam/grid/occupancy_grid.h"
#include "server/slam/recovery/recovery_options.h"
#include "server/slam/recovery/searched_map.h"

namespace cairn::slam {

class KnownGrid final : public SearchedMap {
 public:
  // Tiles of level 0 by their place.
  using Tiles = std::map<ChunkKey, std::shared_ptr<const TileCells>>;
  struct Source {
    Tiles tiles;
    double resolution_m = 0.05;  // Side of a cell.
    std::uint32_t epoch = 0;     // Of the map of the site.
  };
  // A search takes memory for all of the area, so a map of a larger one is none. REQUIRES of the constructor:
  // IsBounded.
  static constexpr double kMostM = 1000.0;
  [[nodiscard]] static bool IsBounded(const Source& source);
  // `near_m`: as SelfCheckOptions.
  KnownGrid(Source source, const PlaceSearchOptions& options, double near_m);
  // Whether a map made of these would be the same as this one.
  [[nodiscard]] bool IsOf(const Source& source, const PlaceSearchOptions& options, double near_m) const;
  [[nodiscard]] bool IsSameAs(const KnownGrid& other) const;

  [[nodiscard]] std::shared_ptr<const IndexedSurfaces> Index() const override { return index_; }
  [[nodiscard]] const PointIndex& surfaces() const { return index_->index; }
  // Surfaces through which beams pass, and points of the scan that lie far from any surface where the map is free,
  // contradict. Both are looked at within kMaxVisibleM of the robot.
  [[nodiscard]] VisibilityCounts Compare(const Scan& scan, const std::vector<SurfacePoint>& points_robot,
                                         const Pose2& T_map_robot) const override;
  // Occupancy at a point: 0..100 %, or kUnknownCell.
  [[nodiscard]] std::uint8_t At(const Eigen::Vector2d& p_map) const;
  [[nodiscard]] const Source& source() const { return source_; }

 private:
  [[nodiscard]] std::uint8_t Cell(int x, int y) const;
  [[nodiscard]] int CellOf(double coordinate_m) const;
  void AddSurfacesAt(int x, int y, std::vector<SurfacePoint>& surfaces) const;
  [[nodiscard]] VisibilityCounts ComparePoints(const std::vector<SurfacePoint>& points_robot, const Pose2& T_map_robot,
                                               double max_range_m) const;
  [[nodiscard]] std::vector<SurfacePoint> SurfacesNear(const Eigen::Vector2d& p_map, double distance_m) const;

  [[nodiscard]] bool IsMadeOf(const Source& source, double cell_scale, double near_m) const;

  Source source_;
  double cell_scale_;
  double near_m_;
  std::shared_ptr<const IndexedSurfaces> index_;
  std::map<std::pair<int, int>, std::vector<SurfacePoint>> squares_;  // The surfaces by squares of the plane.
};

}  // namespace cairn::slam
