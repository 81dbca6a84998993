#include "server/slam/recovery/place_search.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <unordered_set>
#include <utility>

namespace cairn::slam {
namespace {

constexpr int kMapLevels = 7;  // Up to blocks of 13 m.

// The points of one cell on a raster are represented by the first of them.
class OnePerCell {
 public:
  explicit OnePerCell(double cell_m) : cell_m_(cell_m) {}
  bool Takes(const Eigen::Vector2d& p) {
    const auto x = static_cast<std::int64_t>(std::floor(p.x() / cell_m_));
    const auto y = static_cast<std::int64_t>(std::floor(p.y() / cell_m_));
    return taken_.insert((x << 32) ^ (y & 0xffffffff)).second;
  }

 private:
  double cell_m_;
  std::unordered_set<std::int64_t> taken_;
};

// The surface points of the scans, one per cell, in the frame of the last scan.
std::vector<SurfacePoint> SurfacesOf(std::span<const RecentScan> recent, double cell_m) {
  std::vector<SurfacePoint> surfaces;
  OnePerCell cells(cell_m);
  for (const RecentScan& one : recent) {
    const Pose2 T_last_robot = Between(recent.back().T_track_robot, one.T_track_robot);
    const Eigen::Matrix2d R = T_last_robot.rotation();
    for (const SurfacePoint& point : one.points) {
      const Eigen::Vector2d p = R * point.p + T_last_robot.translation();
      if (cells.Takes(p)) surfaces.push_back({p, R * point.normal});
    }
  }
  return surfaces;
}

SearchWindow WindowOver(const std::vector<SurfacePoint>& surfaces) {
  Eigen::AlignedBox2d box;
  for (const SurfacePoint& surface : surfaces) box.extend(surface.p);
  const Eigen::Vector2d centre = box.center();
  return {{centre.x(), centre.y(), 0.0}, 0.5 * box.sizes().maxCoeff(), kPi};
}

}  // namespace

PlaceSearch::Map::Map(std::vector<SurfacePoint> given, double cell_scale)
    : surfaces(std::move(given)),
      pyramid(surfaces, cell_scale * kSearchCellM, cell_scale * kLikelihoodReachM, kMapLevels),
      index(surfaces),
      window(WindowOver(surfaces)) {}

PlaceSearch::PlaceSearch(const PlaceSearchOptions& options, const LoopOptions& loop, const SelfCheckOptions& check,
                         const PointToLineOptions& align)
    : options_(options), loop_(loop), check_(check), align_(align) {
  align_.min_score = options_.min_explained;
}

// Leaves out keyframes that are not localized.
std::vector<SurfacePoint> PlaceSearch::SurfacesOfMap(const Trail& trail, const PosePath& path) const {
  std::vector<SurfacePoint> surfaces;
  OnePerCell cells(0.5 * kSearchCellM);
  const Eigen::Vector2d last = path[trail.size() - 1].translation();
  for (std::size_t k = 0; k < trail.size(); ++k) {
    const Pose2& T_map_k = path[k];
    if (!trail.keyframes()[k].localized) continue;
    if ((T_map_k.translation() - last).cwiseAbs().maxCoeff() > options_.map_reach_m) continue;
    const Eigen::Matrix2d R = T_map_k.rotation();
    const SharedPoints points = trail.points(k);
    for (const SurfacePoint& point : *points) {
      const Eigen::Vector2d p = R * point.p + T_map_k.translation();
      if (cells.Takes(p)) surfaces.push_back({p, R * point.normal});
    }
  }
  return surfaces;
}

std::optional<FoundPlace> PlaceSearch::Find(const Trail& trail, const PosePath& path,
                                            std::span<const RecentScan> recent) {
  return FindWithin(nullptr, trail, path, recent);
}

std::optional<FoundPlace> PlaceSearch::FindNear(const Trail& trail, const PosePath& path,
                                                std::span<const RecentScan> recent, const Pose2& T_map_robot) {
  const SearchWindow window{T_map_robot, options_.near_m, options_.near_rad};
  return FindWithin(&window, trail, path, recent);
}

std::optional<FoundPlace> PlaceSearch::FindWithin(const SearchWindow* window, const Trail& trail, const PosePath& path,
                                                  std::span<const RecentScan> recent) {
  if (recent.empty() || MapOf(trail, path).surfaces.size() < kMinSurfaces) return std::nullopt;
  const std::vector<SurfacePoint> surfaces = SurfacesOf(recent, options_.cell_scale * kSearchCellM);
  if (surfaces.size() < kMinSurfaces) return std::nullopt;
  const auto unique =
      FindUniquePose(surfaces, map_->pyramid, window != nullptr ? *window : map_->window, loop_.max_rival);
  if (!unique) return std::nullopt;
  return Fit(trail, path, recent, surfaces, *unique, UniquePoseCovariance());
}

const PlaceSearch::Map& PlaceSearch::MapOf(const Trail& trail, const PosePath& path) {
  if (!map_) map_ = std::make_shared<const Map>(SurfacesOfMap(trail, path), options_.cell_scale);
  return *map_;
}

double PlaceSearch::ScoreAt(const Trail& trail, const PosePath& path, std::span<const RecentScan> recent,
                            const Pose2& T_map_robot) {
  const auto points = SampleOf(SurfacesOf(recent, options_.cell_scale * kSearchCellM));
  const LikelihoodPyramid& pyramid = MapOf(trail, path).pyramid;
  const auto best = FindBestPose(points, pyramid, {T_map_robot, 2.0 * pyramid.cell_m(), 2.0 * kFoundSigmaRad}, 0.0);
  return best ? best->score : 0.0;
}

bool PlaceSearch::FitsElsewhere(const Trail& trail, const PosePath& path, std::span<const RecentScan> recent,
                                const Pose2& T_map_robot, double score) {
  const auto points = SampleOf(SurfacesOf(recent, options_.cell_scale * kSearchCellM));
  const Map& map = MapOf(trail, path);
  return FindBestPose(points, map.pyramid, map.window, score, ApartFrom(T_map_robot)).has_value();
}

std::optional<FoundPlace> PlaceSearch::Fit(const Trail& trail, const PosePath& path, std::span<const RecentScan> recent,
                                           const std::vector<SurfacePoint>& surfaces, const Pose2& T_map_robot,
                                           const Eigen::Matrix3d& covariance) const {
  const MatchResult match =
      AlignPointsToSurfaces(surfaces, map_->index, {T_map_robot, T_map_robot, covariance}, align_);
  if (!match.converged || match.degenerate) return std::nullopt;
  // Every one of the scans, not only the last ones: a place that looks like the true one differs from it somewhere.
  VisibilityCounts all;
  for (const RecentScan& one : recent) {
    const Pose2 T_map_one = match.T_ref_curr * Between(recent.back().T_track_robot, one.T_track_robot);
    const VisibilityCounts counts = Visible(trail, path, *one.scan, one.points, T_map_one);
    all += counts;
    if (&one == &recent.back() && counts.known() < options_.min_compared) return std::nullopt;
  }
  if (all.contradicted > options_.max_conflict * all.known()) return std::nullopt;
  return FoundPlace{match.T_ref_curr, match.covariance + PoseCovariance(loop_.sigma_m, kFoundSigmaRad)};
}

VisibilityCounts PlaceSearch::Visible(const Trail& trail, const PosePath& path, const Scan& scan,
                                      const std::vector<SurfacePoint>& points_robot, const Pose2& T_map_robot) const {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  BestPlaces near(shapes, options_.apart_m, static_cast<std::size_t>(options_.near_keyframes));
  ForEachNear(path, shapes.size(), T_map_robot.translation(), kMaxVisibleM, [&](std::size_t k, const Pose2& there) {
    const double distance_m = (there.translation() - T_map_robot.translation()).norm();
    if (!trail.keyframes()[k].localized || distance_m > kMaxVisibleM) return;
    near.Add({k, distance_m + std::abs(AngleDiff(there.theta, T_map_robot.theta))});
  });
  VisibilityCounts counts;
  for (const std::size_t k : near.Take()) {
    counts += CompareBothWays(*trail.keyframes()[k].scan, *trail.points(k), scan, points_robot,
                              Between(path[k], T_map_robot), check_.near_m);
  }
  return counts;
}

PlaceSearch::Agreement PlaceSearch::Compare(const Trail& trail, const PosePath& path, const Scan& scan,
                                            const std::vector<SurfacePoint>& points_robot,
                                            const Pose2& T_map_robot) const {
  const VisibilityCounts counts = Visible(trail, path, scan, points_robot, T_map_robot);
  if (counts.known() < options_.min_compared) return Agreement::kNothingNear;
  // As the self-check judges a pose that was wrong before.
  const bool contradicted = counts.contradicted > 0.5 * check_.max_conflict * counts.known();
  if (contradicted) return Agreement::kContradicts;
  return counts.contradicted > options_.max_conflict * counts.known() ? Agreement::kDoubtful : Agreement::kAgrees;
}

}  // namespace cairn::slam
