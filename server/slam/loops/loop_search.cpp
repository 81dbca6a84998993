#include "server/slam/loops/loop_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/loops/region_search.h"

namespace cairn::slam {
namespace {

constexpr int kLevels = 5;
// Half or twice of these two changes nothing on the first 4500 scans of mit-killian (study `sensitivity`).
constexpr std::size_t kMaxSearchPoints = 250;  // Most surface points of the recent keyframes used.
constexpr std::size_t kMaxCandidates = 2;      // Most old places compared at one keyframe.

std::vector<Eigen::Vector2d> Sample(const std::vector<SurfacePoint>& surfaces) {
  const std::size_t stride = surfaces.size() / kMaxSearchPoints + 1;
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < surfaces.size(); i += stride) points.push_back(surfaces[i].p);
  return points;
}

PointIndex IndexOf(const std::vector<SurfacePoint>& surfaces, double cell_m) {
  PointIndex index(cell_m);
  for (const SurfacePoint& point : surfaces) index.Add(point);
  return index;
}

// Numbers of `surfaces`, transformed by `T`, that agree with the other side and that contradict it.
struct Agreement {
  int explained = 0;
  int conflicts = 0;
  [[nodiscard]] double conflict() const {
    return conflicts / std::max(1.0, static_cast<double>(explained + conflicts));
  }
};

Agreement Weigh(const std::vector<SurfacePoint>& surfaces, const Pose2& T, const PointIndex& other,
                const FreeSpace& other_free, double near_m) {
  Agreement agreement;
  for (const SurfacePoint& surface : surfaces) {
    const Eigen::Vector2d p = T * surface.p;
    if (other.Nearest(p, near_m) != nullptr) {
      ++agreement.explained;
    } else if (other_free.Contradicts(p)) {
      ++agreement.conflicts;
    }
  }
  return agreement;
}

}  // namespace

void Visit(OptionVisitor& visitor, LoopOptions& options) {
  visitor.Flag("enabled", options.enabled,
               ForOperators("Whether large loops are searched for. This takes time, and is needed where a robot "
                            "returns after a long way."));
  visitor.Real("min_way_m", options.min_way_m, "m", 1.0, 10000.0,
               "Shortest way along the known relations between the robot and the old place of a large loop. Nearer "
               "places are revisits.");
  visitor.Real("every_m", options.every_m, "m", 0.0, 100.0,
               "Way between two searches. Smaller values find loops sooner and take more time.");
  visitor.Real("recent_m", options.recent_m, "m", 1.0, 100.0,
               "Length of the last part of the path whose surfaces are compared.");
  visitor.Real("around_m", options.around_m, "m", 1.0, 100.0,
               "Length of the old path, before and after the old place, whose surfaces are compared.");
  visitor.Real("doubt_m", options.doubt_m, "m", 0.1, 100.0, "Smallest half width of the search window.");
  visitor.Real("doubt_per_m", options.doubt_per_m, "m/m", 0.0, 1.0,
               "Growth of the half width of the window per metre of way between the robot and the old place.");
  visitor.Real("doubt_rad", options.doubt_rad, "rad", 0.01, 3.2, "Smallest turn that is searched to either side.");
  visitor.Real("doubt_rad_per_m", options.doubt_rad_per_m, "rad/m", 0.0, 1.0,
               "Growth of that turn per metre of way between the robot and the old place.");
  visitor.Real("max_doubt_m", options.max_doubt_m, "m", 0.1, 30.0, "Largest half width of the search window.");
  visitor.Real("max_doubt_rad", options.max_doubt_rad, "rad", 0.01, 1.6,
               "Largest turn that is searched to either side.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0, "Smallest mean likelihood of the recent surfaces.");
  visitor.Real("max_rival", options.max_rival, "1", 0.0, 1.0,
               "Largest ratio of the score of the best other pose to that of the best pose. A larger value finds loops "
               "sooner, and more wrong ones.");
  visitor.Real("min_explained", options.min_explained, "1", 0.0, 1.0,
               "Smallest share of the recent surfaces that must be found again.");
  visitor.Real("max_conflict", options.max_conflict, "1", 0.0, 1.0,
               "Largest share of surfaces that lie where beams have passed.");
  visitor.Real("confirm_after_m", options.confirm_after_m, "m", 0.0, 100.0,
               "Smallest way between the two comparisons that must agree.");
  visitor.Real("confirm_within_m", options.confirm_within_m, "m", 0.0, 1000.0,
               "Largest way between the two comparisons that must agree.");
  visitor.Real("agree_m", options.agree_m, "m", 0.01, 10.0,
               "Largest distance between the poses of two comparisons that agree.");
  visitor.Real("agree_rad", options.agree_rad, "rad", 0.001, 1.0,
               "Largest turn between the poses of two comparisons that agree.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.001, 5.0,
               "Standard deviation of the position in the relation of a loop.");
  visitor.Real("sigma_rad", options.sigma_rad, "rad", 0.0001, 1.0,
               "Standard deviation of the heading in the relation of a loop.");
  visitor.Require(options.doubt_m <= options.max_doubt_m, "doubt_m", "must not exceed", "max_doubt_m");
  visitor.Require(options.doubt_rad <= options.max_doubt_rad, "doubt_rad", "must not exceed", "max_doubt_rad");
  visitor.Require(options.confirm_after_m <= options.confirm_within_m, "confirm_after_m", "must not exceed",
                  "confirm_within_m");
}

LoopSearch::LoopSearch(const LoopOptions& options, const PointToLineOptions& align) : options_(options), align_(align) {
  align_.min_score = options.min_explained;
}

double LoopSearch::Reach(double way_m) const {
  return std::min(options_.max_doubt_m, options_.doubt_m + options_.doubt_per_m * way_m);
}

Eigen::Matrix3d LoopSearch::Covariance() const {
  return Eigen::Vector3d(options_.sigma_m * options_.sigma_m, options_.sigma_m * options_.sigma_m,
                         options_.sigma_rad * options_.sigma_rad)
      .asDiagonal();
}

std::optional<LoopClosure> LoopSearch::Find(const Trail& trail, const SharedSequence<Pose2>& path) {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const double here_m = shapes.back().travelled_m;
  if (!options_.enabled || here_m - searched_at_m_ < options_.every_m) return std::nullopt;
  searched_at_m_ = here_m;
  while (!unconfirmed_.empty() && here_m - shapes[unconfirmed_.front().recent].travelled_m > options_.confirm_within_m)
    unconfirmed_.pop_front();

  std::vector<LoopClosure> found;
  for (const std::size_t old : Candidates(trail, path)) {
    const Pose2 guess = Between(path[old], path[shapes.size() - 1]);
    if (const auto closure = Compare(trail, old, guess)) found.push_back(*closure);
  }
  for (const LoopClosure& closure : found) {
    for (const LoopClosure& earlier : unconfirmed_) {
      if (here_m - shapes[earlier.recent].travelled_m < options_.confirm_after_m) continue;
      if (!Agree(earlier, closure, shapes)) continue;
      unconfirmed_.clear();
      return closure;
    }
  }
  unconfirmed_.insert(unconfirmed_.end(), found.begin(), found.end());
  return std::nullopt;
}

// Old keyframes in whose surroundings the robot may be, the most likely first, and only one per place.
std::vector<std::size_t> LoopSearch::Candidates(const Trail& trail, const SharedSequence<Pose2>& path) const {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const std::span<const double> distances_m = trail.distances_m();
  std::vector<KeyframeCost> all;
  const Pose2& here = path[shapes.size() - 1];
  for (std::size_t k = 0; k < shapes.size(); k += static_cast<std::size_t>(options_.candidate_stride)) {
    if (distances_m[k] < options_.min_way_m) continue;
    // Distance divided by the reach.
    const double cost = (path[k].translation() - here.translation()).norm() / Reach(distances_m[k]);
    if (cost < 1.0) all.push_back({k, cost});
  }
  return BestPlaces(std::move(all), shapes, options_.around_m, kMaxCandidates);
}

std::optional<LoopClosure> LoopSearch::Compare(const Trail& trail, std::size_t old,
                                               const Pose2& T_old_recent_guess) const {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const double way_m = trail.distances_m()[old];
  const std::size_t now = shapes.size() - 1;
  const Stretch recent_stretch = StretchAround(shapes, now, options_.recent_m);
  if (old >= recent_stretch.first) return std::nullopt;  // This is the present place, not an old one.
  const Stretch old_stretch = StretchAround(shapes.first(recent_stretch.first), old, options_.around_m);
  const std::vector<SurfacePoint> recent = SurfacesOf(trail, recent_stretch, 2.0 * options_.search_cell_m);
  const std::vector<SurfacePoint> before = SurfacesOf(trail, old_stretch, 0.5 * options_.search_cell_m);
  if (recent.size() < 20 || before.size() < 20) return std::nullopt;

  const LikelihoodPyramid pyramid(before, options_.search_cell_m, options_.likelihood_reach_m, kLevels);
  const std::vector<Eigen::Vector2d> sample = Sample(recent);
  const SearchWindow window{T_old_recent_guess, Reach(way_m),
                            std::min(options_.max_doubt_rad, options_.doubt_rad + options_.doubt_rad_per_m * way_m)};
  const auto peak = FindBestPose(sample, pyramid, window, options_.min_score);
  if (!peak || !peak->complete) return std::nullopt;
  const Exclusion exclusion{peak->T_ref_curr, options_.rival_beyond_m, options_.rival_beyond_rad};
  if (FindBestPose(sample, pyramid, window, options_.max_rival * peak->score, exclusion)) return std::nullopt;

  const PointIndex before_index = IndexOf(before, align_.first_pair_distance_m);
  const Eigen::Matrix3d prior = options_.align_variances.asDiagonal();
  const MatchResult aligned =
      AlignPointsToSurfaces(recent, before_index, {peak->T_ref_curr, peak->T_ref_curr, prior}, align_);
  if (!aligned.converged || aligned.degenerate) return std::nullopt;
  const FreeSpace before_free(trail, old_stretch, options_.free_space),
      recent_free(trail, recent_stretch, options_.free_space);
  const PointIndex recent_index = IndexOf(recent, align_.first_pair_distance_m);
  const double near_m = options_.near_share * align_.inlier_distance_m;
  const Agreement ours = Weigh(recent, aligned.T_ref_curr, before_index, before_free, near_m);
  const Agreement theirs = Weigh(before, aligned.T_ref_curr.Inverse(), recent_index, recent_free, near_m);
  if (ours.explained < options_.min_explained * static_cast<double>(recent.size())) return std::nullopt;
  if (std::max(ours.conflict(), theirs.conflict()) > options_.max_conflict) return std::nullopt;
  return LoopClosure{old, now, aligned.T_ref_curr, Covariance()};
}

bool LoopSearch::Agree(const LoopClosure& a, const LoopClosure& b, std::span<const KeyframeShape> shapes) const {
  // If the old keyframes are far apart, the drift of the front-end between them would count as a
  // disagreement.
  if (std::abs(shapes[a.old].travelled_m - shapes[b.old].travelled_m) > 2.0 * options_.around_m) return false;
  const auto step = [&](std::size_t from, std::size_t to) {
    return Between(shapes[from].T_track_robot, shapes[to].T_track_robot);
  };
  const Pose2 through_a = a.T_old_recent * step(a.recent, b.recent);
  const Pose2 through_b = step(a.old, b.old) * b.T_old_recent;
  return (through_a.translation() - through_b.translation()).norm() < options_.agree_m &&
         std::abs(AngleDiff(through_a.theta, through_b.theta)) < options_.agree_rad;
}

}  // namespace cairn::slam
