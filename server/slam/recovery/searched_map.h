// The map in which a robot is looked for. It says where its surfaces are, and how a scan at a pose agrees with what is
// known to be occupied and free there. Frames: `map`.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "server/slam/loops/region.h"
#include "server/slam/loops/region_search.h"
#include "server/slam/loops/visibility.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/recovery/recovery_options.h"
#include "server/slam/scan/surface_points.h"
#include "server/slam/trail/pose_path.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

// The surfaces of a map, and what finds them fast. Immutable; any thread may read.
struct IndexedSurfaces {
  IndexedSurfaces(std::vector<SurfacePoint> surfaces, double cell_scale);
  std::vector<SurfacePoint> surfaces;
  LikelihoodPyramid pyramid;
  PointIndex index;
  SearchWindow window;  // All of the map, in every heading.
};

class SearchedMap {
 public:
  virtual ~SearchedMap() = default;
  // May take long. The caller keeps the answer as long as the map stays as it is.
  [[nodiscard]] virtual std::shared_ptr<const IndexedSurfaces> Index() const = 0;
  // How a scan at this pose agrees with the map near it.
  [[nodiscard]] virtual VisibilityCounts Compare(const Scan& scan, const std::vector<SurfacePoint>& points_robot,
                                                 const Pose2& T_map_robot) const = 0;

 protected:
  SearchedMap() = default;
  SearchedMap(const SearchedMap&) = default;
  SearchedMap& operator=(const SearchedMap&) = default;
};

// What the scans of a path have shown: `path` has one pose T_map_robot per keyframe of `trail`. Keyframes that are not
// localized are left out. Does not own its arguments.
class PathMap final : public SearchedMap {
 public:
  // `near_m`: as SelfCheckOptions. The part within PlaceSearchOptions::map_reach_m of `middle`, otherwise of the last
  // pose, is searched.
  PathMap(const Trail& trail, const PosePath& path, const PlaceSearchOptions& options, double near_m,
          const std::optional<Eigen::Vector2d>& middle = std::nullopt)
      : trail_(trail), path_(path), options_(options), near_m_(near_m), middle_(middle) {}
  [[nodiscard]] std::shared_ptr<const IndexedSurfaces> Index() const override;
  [[nodiscard]] VisibilityCounts Compare(const Scan& scan, const std::vector<SurfacePoint>& points_robot,
                                         const Pose2& T_map_robot) const override;

 private:
  const Trail& trail_;
  const PosePath& path_;
  const PlaceSearchOptions& options_;
  double near_m_;
  std::optional<Eigen::Vector2d> middle_;
};

}  // namespace cairn::slam
