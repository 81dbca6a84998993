#include "server/slam/loops/loop_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/loops/stretch_match.h"
#include "server/slam/loops/unique_pose.h"

namespace cairn::slam {
namespace {

// Half or twice of each of these changes the results on the first 4500 scans of mit-killian no more than another seed
// (study `sensitivity`).
constexpr std::size_t kMaxCandidates = 2;    // Most old places compared at one keyframe.
constexpr std::size_t kCandidateStride = 4;  // Only every fourth old keyframe is a candidate.

}  // namespace

void Visit(OptionVisitor& visitor, LoopOptions& options) {
  visitor.Flag("enabled", options.enabled,
               ForOperators("Whether large loops are searched for. This takes time, and is needed where a robot "
                            "returns after a long way."));
  visitor.Real("every_m", options.every_m, "m", 0.0, 100.0,
               "Way between two searches. Smaller values find loops sooner and take more time.");
  visitor.Real("doubt_per_m", options.doubt_per_m, "m/m", 0.0, 1.0,
               "Growth of the half width of the window per metre of way between the robot and the old place.");
  visitor.Real("doubt_rad_per_m", options.doubt_rad_per_m, "rad/m", 0.0, 1.0,
               "Growth of the turn that is searched to either side per metre of way between the robot and the old "
               "place.");
  visitor.Real("max_doubt_m", options.max_doubt_m, "m", kLeastDoubtM, 30.0,
               "Largest half width of the search window. The time of a search grows with the square.");
  visitor.Real(
      "max_rival", options.max_rival, "1", 0.0, 1.0,
      "Largest ratio of the score of the best other pose to that of the best pose. A larger value finds loops "
      "sooner, and more wrong ones. With every_m, confirm_after_m and sigma_m it also counts when a robot that was not "
      "watched is looked for in its map; enabled does not.");
  visitor.Real("max_conflict", options.max_conflict, "1", 0.0, 1.0,
               "Largest share of surfaces that lie where beams have passed.");
  visitor.Real("confirm_after_m", options.confirm_after_m, "m", 0.0, kConfirmWithinM,
               "Smallest way between the two comparisons that must agree.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.001, 5.0,
               "Standard deviation of the position in the relation of a loop.");
  visitor.Real("free_cell_m", options.free_cell_m, "m", 0.05, 1.0,
               "Cell of the raster that remembers where beams have passed, for max_conflict. With twice the value the "
               "smoothed error on the first 4500 scans of mit-killian is 0.8 times as large.");
}

LoopSearch::LoopSearch(const LoopOptions& options, const PointToLineOptions& align)
    : options_(options), align_(align) {}

double LoopSearch::Reach(double way_m) const {
  return WindowAround({}, way_m, options_).reach_m;
}

// A keyframe does one comparison at most, because a robot waits for its pose.
std::optional<LoopClosure> LoopSearch::Find(const Trail& trail, const PosePath& path) {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const std::size_t now = shapes.size() - 1;
  const double here_m = shapes[now].travelled_m;
  if (!options_.enabled) return std::nullopt;
  const auto began = static_cast<std::size_t>(
      std::ranges::lower_bound(shapes, searched_at_m_, {}, &KeyframeShape::travelled_m) - shapes.begin());
  if (!unconfirmed_.empty() && unconfirmed_.back().recent >= began &&
      PartAt(unconfirmed_.back().recent, began).confirms) {
    const LoopClosure confirmed = SeenFrom(now, unconfirmed_.back(), shapes);
    unconfirmed_.clear();
    return confirmed;
  }
  const Part part = PartAt(now, began);
  if (now > began && part.candidate < kMaxCandidates) {
    if (!part.confirms) {
      CompareCandidate(part.candidate, trail, path);
    } else if (const LoopClosure closure = SeenFrom(now, unconfirmed_.back(), shapes);
               Confirms(trail, path, closure, began)) {
      unconfirmed_.push_back(closure);
    }
    return std::nullopt;
  }
  if (here_m - searched_at_m_ < options_.every_m) return std::nullopt;
  searched_at_m_ = here_m;
  while (!unconfirmed_.empty() && here_m - shapes[unconfirmed_.front().recent].travelled_m > kConfirmWithinM)
    unconfirmed_.pop_front();
  CompareCandidate(0, trail, path);
  return std::nullopt;
}

// Each candidate is compared at one keyframe, and if that has found something, it is confirmed at the next one. So what
// a keyframe does follows from where the search began and at which keyframes something was found, and a restart needs
// to know no more than that.
LoopSearch::Part LoopSearch::PartAt(std::size_t keyframe, std::size_t began) const {
  Part part;
  for (std::size_t k = began; k < keyframe && part.candidate < kMaxCandidates; ++k) {
    const bool found = std::ranges::find(unconfirmed_, k, &LoopClosure::recent) != unconfirmed_.end();
    if (found && !part.confirms) {
      part.confirms = true;
    } else {
      part = {part.candidate + 1, false};
    }
  }
  return part;
}

void LoopSearch::CompareCandidate(std::size_t number, const Trail& trail, const PosePath& path) {
  const std::vector<std::size_t> candidates = Candidates(trail, path);
  if (number >= candidates.size()) return;
  const std::size_t old = candidates[number];
  const Pose2 guess = Between(path[old], path[trail.size() - 1]);
  if (const auto closure = Compare(trail, old, guess, 0)) unconfirmed_.push_back(*closure);
}

LoopClosure LoopSearch::SeenFrom(std::size_t keyframe, const LoopClosure& closure,
                                 std::span<const KeyframeShape> shapes) {
  const Pose2 step = Between(shapes[closure.recent].T_track_robot, shapes[keyframe].T_track_robot);
  return {closure.old, keyframe, closure.T_old_recent * step, closure.covariance};
}

void LoopSearch::Retire(const Retirement& retirement) {
  std::erase_if(unconfirmed_,
                [&](const LoopClosure& one) { return !retirement.IsKept(one.old) || !retirement.IsKept(one.recent); });
  for (LoopClosure& one : unconfirmed_) {
    one.old = retirement.index_after[one.old];
    one.recent = retirement.index_after[one.recent];
  }
}

// Old keyframes in whose surroundings the robot may be, the most likely first, and only one per place.
std::vector<std::size_t> LoopSearch::Candidates(const Trail& trail, const PosePath& path) const {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  BestPlaces best(shapes, kStretchM, kMaxCandidates);
  const Pose2& here = path[shapes.size() - 1];
  const auto look = [&](std::size_t k, const Pose2& there) {
    if (k % kCandidateStride != 0) return;
    const double away_m = (there.translation() - here.translation()).norm();
    if (away_m >= options_.max_doubt_m || !trail.IsFarther(k, kLargeLoopM)) return;
    const double cost = away_m / Reach(trail.distances_m()[k]);  // Distance divided by the reach.
    if (cost < 1.0) best.Add({k, cost});
  };
  const auto enter = [&](const PathBounds& bounds, std::size_t begin, std::size_t end) {
    return !trail.AllWithin(begin, end, kLargeLoopM) && bounds.IsWithin(options_.max_doubt_m, here.translation());
  };
  path.ForEach(shapes.size(), enter, look);
  return best.Take();
}

// Two stretches of 15 m that end some metres apart show nearly the same. Where that looks like another place, both
// agree on the wrong one. So what has been seen since the earlier of the two must show the same by itself.
bool LoopSearch::Confirms(const Trail& trail, const PosePath& path, const LoopClosure& closure,
                          std::size_t before) const {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const Pose2 guess = Between(path[closure.old], path[closure.recent]);
  for (const LoopClosure& earlier : unconfirmed_) {
    if (earlier.recent >= before) break;
    if (shapes[closure.recent].travelled_m - shapes[earlier.recent].travelled_m < options_.confirm_after_m) continue;
    if (!Agree(earlier, closure, shapes)) continue;
    // It is the earliest one, since which the robot has seen the most.
    const auto alone = Compare(trail, closure.old, guess, earlier.recent + 1);
    return alone && Agree(earlier, *alone, shapes);
  }
  return false;
}

std::optional<LoopClosure> LoopSearch::Compare(const Trail& trail, std::size_t old, const Pose2& T_old_recent_guess,
                                               std::size_t since) const {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const double way_m = trail.distances_m()[old];
  const std::size_t now = shapes.size() - 1;
  Stretch recent_stretch = StretchAround(shapes, now, kStretchM);
  recent_stretch.first = std::max(recent_stretch.first, since);
  if (old >= recent_stretch.first) return std::nullopt;  // This is the present place, not an old one.
  const Stretch old_stretch = StretchAround(shapes.first(recent_stretch.first), old, kStretchM);
  const auto T_old_recent = MatchStretches(trail, old_stretch, trail, recent_stretch,
                                           WindowAround(T_old_recent_guess, way_m, options_), options_, align_);
  if (!T_old_recent) return std::nullopt;
  return LoopClosure{old, now, *T_old_recent, PoseCovariance(options_.sigma_m, kFoundSigmaRad)};
}

bool LoopSearch::Agree(const LoopClosure& a, const LoopClosure& b, std::span<const KeyframeShape> shapes) const {
  // If the old keyframes are far apart, the drift of the front-end between them would count as a
  // disagreement.
  if (std::abs(shapes[a.old].travelled_m - shapes[b.old].travelled_m) > 2.0 * kStretchM) return false;
  const auto step = [&](std::size_t from, std::size_t to) {
    return Between(shapes[from].T_track_robot, shapes[to].T_track_robot);
  };
  const Pose2 through_a = a.T_old_recent * step(a.recent, b.recent);
  const Pose2 through_b = step(a.old, b.old) * b.T_old_recent;
  return ConfirmEachOther(through_a, through_b);
}

}  // namespace cairn::slam
