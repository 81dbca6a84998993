#include "server/slam/recovery/searched_map.h"

#include <Eigen/Geometry>
#include <cmath>
#include <utility>

#include "server/slam/loops/unique_pose.h"

namespace cairn::slam {
namespace {

constexpr int kMapLevels = 7;  // Up to blocks of 13 m.

SearchWindow WindowOver(const std::vector<SurfacePoint>& surfaces) {
  if (surfaces.empty()) return {};
  Eigen::AlignedBox2d box;
  for (const SurfacePoint& surface : surfaces) box.extend(surface.p);
  const Eigen::Vector2d centre = box.center();
  return {{centre.x(), centre.y(), 0.0}, 0.5 * box.sizes().maxCoeff(), kPi};
}

}  // namespace

IndexedSurfaces::IndexedSurfaces(std::vector<SurfacePoint> given, double cell_scale)
    : surfaces(std::move(given)),
      pyramid(surfaces, cell_scale * kSearchCellM, cell_scale * kLikelihoodReachM, kMapLevels),
      index(surfaces),
      window(WindowOver(surfaces)) {}

std::shared_ptr<const IndexedSurfaces> PathMap::Index() const {
  std::vector<SurfacePoint> surfaces;
  OnePerCell cells(0.5 * kSearchCellM);
  if (trail_.size() == 0) return std::make_shared<const IndexedSurfaces>(std::move(surfaces), options_.cell_scale);
  const Eigen::Vector2d middle = middle_.value_or(path_[trail_.size() - 1].translation());
  for (std::size_t k = 0; k < trail_.size(); ++k) {
    const Pose2& T_map_k = path_[k];
    if (!trail_.keyframes()[k].localized) continue;
    const Eigen::Vector2d away_m = T_map_k.translation() - middle;
    if (away_m.cwiseAbs().maxCoeff() > options_.map_reach_m) continue;
    const Eigen::Matrix2d R = T_map_k.rotation();
    const SharedPoints points = trail_.points(k);
    for (const SurfacePoint& point : *points) {
      const Eigen::Vector2d p = R * point.p + T_map_k.translation();
      if (cells.Takes(p)) surfaces.push_back({p, R * point.normal});
    }
  }
  return std::make_shared<const IndexedSurfaces>(std::move(surfaces), options_.cell_scale);
}

VisibilityCounts PathMap::Compare(const Scan& scan, const std::vector<SurfacePoint>& points_robot,
                                  const Pose2& T_map_robot) const {
  const std::span<const KeyframeShape> shapes = trail_.shapes();
  BestPlaces near(shapes, options_.apart_m, static_cast<std::size_t>(options_.near_keyframes));
  ForEachNear(path_, shapes.size(), T_map_robot.translation(), kMaxVisibleM, [&](std::size_t k, const Pose2& there) {
    const double distance_m = (there.translation() - T_map_robot.translation()).norm();
    if (!trail_.keyframes()[k].localized || distance_m > kMaxVisibleM) return;
    near.Add({k, distance_m + std::abs(AngleDiff(there.theta, T_map_robot.theta))});
  });
  VisibilityCounts counts;
  for (const std::size_t k : near.Take()) {
    counts += CompareBothWays(*trail_.keyframes()[k].scan, *trail_.points(k), scan, points_robot,
                              Between(path_[k], T_map_robot), near_m_);
  }
  return counts;
}

}  // namespace cairn::slam
