#include "server/slam/matching/loop_search.h"

#include <algorithm>
#include <cmath>

#include "server/slam/matching/region_search.h"

namespace cairn::slam {
namespace {

constexpr double kSearchCellM = 0.1;
constexpr double kLikelihoodReachM = 0.3;
constexpr int kLevels = 5;
constexpr std::size_t kMaxSearchPoints = 250;
constexpr std::size_t kMaxCandidates = 2;
constexpr std::size_t kCandidateStride = 4;  // Of the old keyframes looked at.
constexpr Exclusion kRivalBeyond{{}, 1.0, 0.3};

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

// How many of `surfaces`, put at `T`, are found on the other side, and how many contradict it.
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
  visitor.Flag("enabled", options.enabled, "Search for large loops.");
  visitor.Real("min_way_m", options.min_way_m, "m", 1.0, 10000.0,
               "Along what is known, between here and an old place; nearer: a revisit.");
  visitor.Real("every_m", options.every_m, "m", 0.0, 100.0, "Travelled between searches; smaller: sooner, slower.");
  visitor.Real("recent_m", options.recent_m, "m", 1.0, 100.0, "Length of the way that is compared.");
  visitor.Real("around_m", options.around_m, "m", 1.0, 100.0, "Length of the old way, to either side.");
  visitor.Real("doubt_m", options.doubt_m, "m", 0.1, 100.0, "How far the search reaches ...");
  visitor.Real("doubt_per_m", options.doubt_per_m, "m/m", 0.0, 1.0, "... and more per metre between here and there.");
  visitor.Real("doubt_rad", options.doubt_rad, "rad", 0.01, 3.2, "How far the search turns ...");
  visitor.Real("doubt_rad_per_m", options.doubt_rad_per_m, "rad/m", 0.0, 1.0, "... and more per metre.");
  visitor.Real("max_doubt_m", options.max_doubt_m, "m", 0.1, 30.0, "Upper bound of the reach.");
  visitor.Real("max_doubt_rad", options.max_doubt_rad, "rad", 0.01, 1.6, "Upper bound of the turn.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0, "Mean likelihood of the recent surfaces.");
  visitor.Real("max_rival", options.max_rival, "1", 0.0, 1.0,
               "Score of the best pose elsewhere over the best; larger: sooner, and wrong more often.");
  visitor.Real("min_explained", options.min_explained, "1", 0.0, 1.0, "Share of recent surfaces found again.");
  visitor.Real("max_conflict", options.max_conflict, "1", 0.0, 1.0,
               "Share of surfaces that stand where beams went through.");
  visitor.Real("confirm_after_m", options.confirm_after_m, "m", 0.0, 100.0,
               "Travelled between two comparisons that must agree.");
  visitor.Real("confirm_within_m", options.confirm_within_m, "m", 0.0, 1000.0, "... at most.");
  visitor.Real("agree_m", options.agree_m, "m", 0.01, 10.0, "How far apart agreeing loops may be.");
  visitor.Real("agree_rad", options.agree_rad, "rad", 0.001, 1.0, "... and turned.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.001, 5.0, "Uncertainty of a loop's relation.");
  visitor.Real("sigma_rad", options.sigma_rad, "rad", 0.0001, 1.0, "... and of its heading.");
}

LoopSearch::LoopSearch(const LoopOptions& options, const PointToLineOptions& align) : options_(options), align_(align) {
  align_.min_score = options.min_explained;
}

double LoopSearch::Reach(double way_m) const {
  return std::min(options_.max_doubt_m, options_.doubt_m + options_.doubt_per_m * way_m);
}

std::optional<RevisitObservation> LoopSearch::Find(std::span<const Keyframe> keyframes,
                                                   std::span<const KeyframeShape> shapes,
                                                   const SharedSequence<Pose2>& path,
                                                   std::span<const double> distances_m) {
  const double here_m = shapes.back().travelled_m;
  if (!options_.enabled || here_m - searched_at_m_ < options_.every_m) return std::nullopt;
  searched_at_m_ = here_m;
  while (!unconfirmed_.empty() && here_m - shapes[unconfirmed_.front().recent].travelled_m > options_.confirm_within_m)
    unconfirmed_.pop_front();

  std::vector<Closure> found;
  for (const std::size_t old : Candidates(shapes, path, distances_m)) {
    const Pose2 guess = Between(path[old], path[shapes.size() - 1]);
    if (const auto closure = Compare(keyframes, shapes, old, guess, distances_m[old])) found.push_back(*closure);
  }
  for (const Closure& closure : found) {
    for (const Closure& earlier : unconfirmed_) {
      if (here_m - shapes[earlier.recent].travelled_m < options_.confirm_after_m) continue;
      if (!Agree(earlier, closure, shapes)) continue;
      unconfirmed_.clear();
      RevisitObservation loop{closure.old, closure.T_old_recent, Eigen::Matrix3d::Zero()};
      loop.covariance.diagonal() << options_.sigma_m * options_.sigma_m, options_.sigma_m * options_.sigma_m,
          options_.sigma_rad * options_.sigma_rad;
      return loop;
    }
  }
  unconfirmed_.insert(unconfirmed_.end(), found.begin(), found.end());
  return std::nullopt;
}

// Old keyframes whose surroundings the robot may be in, the likeliest first, not two of one place.
std::vector<std::size_t> LoopSearch::Candidates(std::span<const KeyframeShape> shapes,
                                                const SharedSequence<Pose2>& path,
                                                std::span<const double> distances_m) const {
  struct Candidate {
    std::size_t old;
    double cost;  // Distance over reach.
  };
  std::vector<Candidate> all;
  const Pose2& here = path[shapes.size() - 1];
  for (std::size_t k = 0; k < shapes.size(); k += kCandidateStride) {
    if (distances_m[k] < options_.min_way_m) continue;
    const double cost = (path[k].translation() - here.translation()).norm() / Reach(distances_m[k]);
    if (cost < 1.0) all.push_back({k, cost});
  }
  std::stable_sort(all.begin(), all.end(), [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  std::vector<std::size_t> chosen;
  for (const Candidate& candidate : all) {
    const bool same_place = std::any_of(chosen.begin(), chosen.end(), [&](std::size_t other) {
      return std::abs(shapes[candidate.old].travelled_m - shapes[other].travelled_m) < options_.around_m;
    });
    if (!same_place) chosen.push_back(candidate.old);
    if (chosen.size() == kMaxCandidates) break;
  }
  return chosen;
}

std::optional<LoopSearch::Closure> LoopSearch::Compare(std::span<const Keyframe> keyframes,
                                                       std::span<const KeyframeShape> shapes, std::size_t old,
                                                       const Pose2& T_old_recent_guess, double way_m) const {
  const std::size_t now = shapes.size() - 1;
  const Stretch recent_stretch = StretchAround(shapes, now, options_.recent_m);
  if (old >= recent_stretch.first) return std::nullopt;  // Not an old place but this one.
  const Stretch old_stretch = StretchAround(shapes.first(recent_stretch.first), old, options_.around_m);
  const std::vector<SurfacePoint> recent = SurfacesOf(shapes, recent_stretch, 2.0 * kSearchCellM);
  const std::vector<SurfacePoint> before = SurfacesOf(shapes, old_stretch, 0.5 * kSearchCellM);
  if (recent.size() < 20 || before.size() < 20) return std::nullopt;

  const LikelihoodPyramid pyramid(before, kSearchCellM, kLikelihoodReachM, kLevels);
  const std::vector<Eigen::Vector2d> sample = Sample(recent);
  const SearchWindow window{T_old_recent_guess, Reach(way_m),
                            std::min(options_.max_doubt_rad, options_.doubt_rad + options_.doubt_rad_per_m * way_m)};
  const auto peak = FindBestPose(sample, pyramid, window, options_.min_score);
  if (!peak || !peak->complete) return std::nullopt;
  Exclusion exclusion = kRivalBeyond;
  exclusion.T_ref_curr = peak->T_ref_curr;
  if (FindBestPose(sample, pyramid, window, options_.max_rival * peak->score, exclusion)) return std::nullopt;

  const PointIndex before_index = IndexOf(before, align_.first_pair_distance_m);
  const Eigen::Matrix3d prior = Eigen::Vector3d(0.25, 0.25, 0.01).asDiagonal();
  const MatchResult aligned =
      AlignPointsToSurfaces(recent, before_index, {peak->T_ref_curr, peak->T_ref_curr, prior}, align_);
  if (!aligned.converged || aligned.degenerate) return std::nullopt;
  const FreeSpace before_free(keyframes, shapes, old_stretch), recent_free(keyframes, shapes, recent_stretch);
  const PointIndex recent_index = IndexOf(recent, align_.first_pair_distance_m);
  const double near_m = 2.0 * align_.inlier_distance_m;
  const Agreement ours = Weigh(recent, aligned.T_prev_curr, before_index, before_free, near_m);
  const Agreement theirs = Weigh(before, aligned.T_prev_curr.Inverse(), recent_index, recent_free, near_m);
  if (ours.explained < options_.min_explained * static_cast<double>(recent.size())) return std::nullopt;
  if (std::max(ours.conflict(), theirs.conflict()) > options_.max_conflict) return std::nullopt;
  return Closure{old, now, aligned.T_prev_curr, aligned.score};
}

bool LoopSearch::Agree(const Closure& a, const Closure& b, std::span<const KeyframeShape> shapes) const {
  // Far apart on the old way, the front-end's drift between them would count as disagreement.
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
