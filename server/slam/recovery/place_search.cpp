#include "server/slam/recovery/place_search.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/loops/one_per_cell.h"

namespace cairn::slam {
namespace {

// Places with a smaller share of the best score are none.
constexpr double kLeastOfBest = 0.5;

std::optional<FoundPlace> PlaceOf(const std::optional<PlaceSearch::Returned>& fit) {
  return fit ? std::optional(fit->place) : std::nullopt;
}

// The surface points of the scans, one per cell, in the frame of the last scan.
std::vector<SurfacePoint> SurfacesSeenBy(std::span<const RecentScan> recent, double cell_m) {
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

}  // namespace

PlaceSearch::PlaceSearch(const PlaceSearchOptions& options, const LoopOptions& loop, const SelfCheckOptions& check,
                         const PointToLineOptions& align)
    : options_(options), loop_(loop), check_(check), align_(align) {}

std::optional<FoundPlace> PlaceSearch::Find(const SearchedMap& map, std::span<const RecentScan> recent) {
  return PlaceOf(FindWithin(nullptr, map, recent, usual()));
}

std::optional<FoundPlace> PlaceSearch::FindNear(const SearchedMap& map, std::span<const RecentScan> recent,
                                                const Pose2& T_map_robot, double reach_m, double reach_rad) {
  const SearchWindow window = WindowAround(T_map_robot, reach_m, reach_rad);
  return PlaceOf(FindWithin(&window, map, recent, usual()));
}

std::optional<PlaceSearch::Returned> PlaceSearch::FindReturned(const SearchedMap& map,
                                                               std::span<const RecentScan> recent,
                                                               const Pose2& T_map_robot, double reach_m,
                                                               double reach_rad) {
  const SearchWindow window = WindowAround(T_map_robot, reach_m, reach_rad);
  return FindWithin(&window, map, recent, {align_.min_score, loop_.max_conflict});
}

SearchWindow PlaceSearch::WindowAround(const Pose2& T_map_robot, double reach_m, double reach_rad) const {
  return {T_map_robot, std::max(options_.near_m, reach_m), std::min(kPi, std::max(options_.near_rad, reach_rad))};
}

std::optional<PlaceSearch::Returned> PlaceSearch::FindWithin(const SearchWindow* window, const SearchedMap& map,
                                                             std::span<const RecentScan> recent, const Limits& limits) {
  if (recent.empty() || IndexOf(map).surfaces.size() < kMinSurfaces) return std::nullopt;
  const std::vector<SurfacePoint> surfaces = SurfacesSeenBy(recent, options_.cell_scale * kSearchCellM);
  if (surfaces.size() < kMinSurfaces) return std::nullopt;
  const auto unique =
      FindUniquePose(surfaces, index_->pyramid, window != nullptr ? *window : index_->window, loop_.max_rival);
  if (!unique) return std::nullopt;
  return Fit(map, recent, surfaces, *unique, limits);
}

void PlaceSearch::Begin(const SearchedMap& map, std::span<const RecentScan> recent,
                        const std::optional<Pose2>& T_map_believed) {
  search_.reset();
  if (recent.empty() || IndexOf(map).surfaces.size() < kMinSurfaces) return;
  const std::vector<SurfacePoint> surfaces = SurfacesSeenBy(recent, options_.cell_scale * kSearchCellM);
  if (surfaces.size() < kMinSurfaces) return;
  search_.emplace(Search{{surfaces, index_->pyramid, index_->window, loop_.max_rival}, recent.back().T_track_robot});
  if (T_map_believed) search_->poses.LookFirstIn({*T_map_believed, options_.near_m, options_.near_rad});
}

PlaceSearch::Ended PlaceSearch::End(const SearchedMap& map, std::span<const RecentScan> recent) {
  const Search search = *std::exchange(search_, std::nullopt);
  if (!search.poses.best()) return {};
  const Pose2 T_map_robot = *search.poses.best() * Between(search.T_track_robot, recent.back().T_track_robot);
  const auto best =
      PlaceOf(Fit(map, recent, SurfacesSeenBy(recent, options_.cell_scale * kSearchCellM), T_map_robot, usual()));
  return {search.poses.found() ? best : std::nullopt, best};
}

RankedPlaces PlaceSearch::Rank(const SearchedMap& map, std::span<const RecentScan> recent, std::size_t most,
                               const std::function<bool()>& go_on) {
  RankedPlaces ranked;
  if (recent.empty() || IndexOf(map).surfaces.size() < kMinSurfaces) return ranked;
  const auto surfaces = SurfacesSeenBy(recent, options_.cell_scale * kSearchCellM);
  if (surfaces.size() < kMinSurfaces) return ranked;
  const auto points = SampleOf(surfaces);
  std::vector<Exclusion> known;
  while (ranked.places.size() < most && go_on()) {
    const double least = known.empty() ? kMinLikelihood : kLeastOfBest * ranked.places.front().score;
    const auto peak = FindBestPose(points, index_->pyramid, index_->window, least, known);
    ranked.complete = !peak || peak->complete;
    if (!peak || !ranked.complete) break;
    ranked.places.push_back({peak->T_ref_curr, peak->score});
    known.push_back(ApartFrom(peak->T_ref_curr));
  }
  if (ranked.places.empty() || !go_on()) return ranked;
  ranked.found = Find(map, recent);
  if (ranked.found) ranked.places.front().T_map_robot = ranked.found->T_map_robot;
  return ranked;
}

const IndexedSurfaces& PlaceSearch::IndexOf(const SearchedMap& map) {
  if (!index_) index_ = map.Index();
  return *index_;
}

double PlaceSearch::ScoreAt(const SearchedMap& map, std::span<const RecentScan> recent, const Pose2& T_map_robot) {
  const auto points = SampleOf(SurfacesSeenBy(recent, options_.cell_scale * kSearchCellM));
  const LikelihoodPyramid& pyramid = IndexOf(map).pyramid;
  const auto best = FindBestPose(points, pyramid, {T_map_robot, 2.0 * pyramid.cell_m(), 2.0 * kFoundSigmaRad}, 0.0);
  return best ? best->score : 0.0;
}

bool PlaceSearch::FitsElsewhere(const SearchedMap& map, std::span<const RecentScan> recent, const Pose2& T_map_robot,
                                double score) {
  const auto points = SampleOf(SurfacesSeenBy(recent, options_.cell_scale * kSearchCellM));
  const IndexedSurfaces& index = IndexOf(map);
  const Exclusion own = ApartFrom(T_map_robot);
  PoseSearch search(points, index.pyramid, index.window);
  search.Begin(score, std::span(&own, 1), true);
  search.GoOn(kMaxBlocks);
  return search.peak().has_value();
}

std::optional<PlaceSearch::Returned> PlaceSearch::Fit(const SearchedMap& map, std::span<const RecentScan> recent,
                                                      const std::vector<SurfacePoint>& surfaces,
                                                      const Pose2& T_map_robot, const Limits& limits) const {
  PointToLineOptions align = align_;
  align.min_score = limits.min_explained;
  const MatchResult match =
      AlignPointsToSurfaces(surfaces, index_->index, {T_map_robot, T_map_robot, UniquePoseCovariance()}, align);
  if (!match.converged || match.degenerate) return std::nullopt;
  // Every one of the scans, not only the last ones: a place that looks like the true one differs from it somewhere.
  VisibilityCounts all;
  for (const RecentScan& one : recent) {
    const Pose2 T_map_one = match.T_ref_curr * Between(recent.back().T_track_robot, one.T_track_robot);
    const VisibilityCounts counts = map.Compare(*one.scan, one.points, T_map_one);
    all += counts;
    if (&one == &recent.back() && counts.known() < options_.min_compared) return std::nullopt;
  }
  if (all.contradicted > limits.max_conflict * all.known()) return std::nullopt;
  const bool clear = match.score >= options_.min_explained && all.contradicted <= options_.max_conflict * all.known();
  return Returned{{match.T_ref_curr, match.covariance + PoseCovariance(loop_.sigma_m, kFoundSigmaRad)}, clear};
}

PlaceSearch::Agreement PlaceSearch::Compare(const SearchedMap& map, const Scan& scan,
                                            const std::vector<SurfacePoint>& points_robot,
                                            const Pose2& T_map_robot) const {
  const VisibilityCounts counts = map.Compare(scan, points_robot, T_map_robot);
  if (counts.known() < options_.min_compared) return Agreement::kNothingNear;
  // As the self-check judges a pose that was wrong before.
  const bool contradicted = counts.contradicted > 0.5 * check_.max_conflict * counts.known();
  if (contradicted) return Agreement::kContradicts;
  return counts.contradicted > options_.max_conflict * counts.known() ? Agreement::kDoubtful : Agreement::kAgrees;
}

}  // namespace cairn::slam
