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
constexpr std::uint32_t kMaxCandidates = 2;  // Most old places compared by one search.
constexpr std::size_t kCandidateStride = 4;  // Only every fourth old keyframe is a candidate.

constexpr int kBlocksPerScan = 20'000;  // Evaluated in about 2 ms.
// More than any comparison has.
constexpr std::uint32_t kMostParts = kMaxBlocks / kBlocksPerScan * 3;

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
LoopSearch::~LoopSearch() = default;

double LoopSearch::Reach(double way_m) const {
  return WindowAround({}, way_m, options_).reach_m;
}

bool LoopSearch::IsConsistent() const {
  const bool due = candidate_ <= kMaxCandidates && due_ <= Due::kClose;
  const bool found = (due_ != Due::kConfirm && due_ != Due::kClose) || !unconfirmed_.empty();
  const bool whole =
      !comparison_ || ((due_ == Due::kCompare || due_ == Due::kConfirm) && comparison_->since <= comparison_->recent &&
                       comparison_->way_m >= 0.0 && comparison_->parts_done <= kMostParts);
  return due && found && whole;
}

std::optional<LoopClosure> LoopSearch::Find(const Trail& trail, const PosePath& path) {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const double here_m = shapes.back().travelled_m;
  if (!options_.enabled) return std::nullopt;
  if (comparison_ || due_ == Due::kClose) return GoOn(trail);
  if (due_ == Due::kNothing) {
    if (here_m - searched_at_m_ < options_.every_m) return std::nullopt;
    searched_at_m_ = here_m;
    while (!unconfirmed_.empty() && here_m - shapes[unconfirmed_.front().recent].travelled_m > kConfirmWithinM)
      unconfirmed_.pop_front();
    candidate_ = 0;
    due_ = Due::kCompare;
  }
  due_ == Due::kConfirm ? Confirm(trail, path) : CompareCandidate(trail, path);
  return std::nullopt;
}

// Each scan does one part at most, because a robot waits for its pose.
std::optional<LoopClosure> LoopSearch::GoOn(const Trail& trail) {
  if (comparison_) {
    GoOnComparing(trail);
    return std::nullopt;
  }
  if (due_ != Due::kClose) return std::nullopt;
  const LoopClosure confirmed = SeenFrom(trail.size() - 1, unconfirmed_.back(), trail.shapes());
  ForgetUnconfirmed();
  return confirmed;
}

void LoopSearch::GoOnComparing(const Trail& trail) {
  if (match_ == nullptr) {  // After a restart: the parts that were done before it are done again.
    for (std::uint32_t part = std::exchange(comparison_->parts_done, 0); part > 0; --part)
      if (DoPart(trail)) return;
  }
  DoPart(trail);
}

bool LoopSearch::DoPart(const Trail& trail) {
  Comparison& comparison = *comparison_;
  ++comparison.parts_done;
  const std::span<const KeyframeShape> shapes = trail.shapes();
  if (match_ == nullptr) {
    const std::span<const KeyframeShape> until = shapes.first(comparison.recent + 1);
    Stretch recent_stretch = StretchAround(until, comparison.recent, kStretchM);
    recent_stretch.first = std::max(recent_stretch.first, comparison.since);
    if (comparison.old >= recent_stretch.first) {  // This is the present place, not an old one.
      End(std::nullopt, shapes);
      return true;
    }
    const Stretch old_stretch = StretchAround(shapes.first(recent_stretch.first), comparison.old, kStretchM);
    match_ = std::make_unique<StretchMatch>(trail, old_stretch, trail, recent_stretch,
                                            WindowAround(comparison.T_old_recent_guess, comparison.way_m, options_),
                                            options_.max_rival);
    return false;
  }
  if (!match_->GoOn(trail, trail, kBlocksPerScan, options_, align_)) return false;
  std::optional<LoopClosure> found;
  if (match_->found())
    found = {comparison.old, comparison.recent, *match_->found(), PoseCovariance(options_.sigma_m, kFoundSigmaRad)};
  End(found, shapes);
  return true;
}

void LoopSearch::End(const std::optional<LoopClosure>& found, std::span<const KeyframeShape> shapes) {
  const std::size_t recent = comparison_->recent;
  comparison_.reset();
  match_.reset();
  if (!found) return GoToNextCandidate();
  if (due_ == Due::kCompare) {
    unconfirmed_.push_back(*found);
    due_ = Due::kConfirm;
    return;
  }
  const LoopClosure closure = SeenFrom(recent, unconfirmed_.back(), shapes);
  const LoopClosure* const earlier = Earlier(closure, shapes);
  if (earlier == nullptr || !Agree(*earlier, *found, shapes)) return GoToNextCandidate();
  unconfirmed_.push_back(closure);
  due_ = Due::kClose;
}

void LoopSearch::GoToNextCandidate() {
  ++candidate_;
  due_ = candidate_ < kMaxCandidates ? Due::kCompare : Due::kNothing;
}

void LoopSearch::CompareCandidate(const Trail& trail, const PosePath& path) {
  const std::vector<std::size_t> candidates = Candidates(trail, path);
  if (candidate_ >= candidates.size()) return GoToNextCandidate();
  const std::size_t old = candidates[candidate_], now = trail.size() - 1;
  comparison_ = {old, now, 0, Between(path[old], path[now]), trail.distances_m()[old]};
}

// Two stretches of 15 m that end some metres apart show nearly the same. Where that looks like another place, both
// agree on the wrong one. So what has been seen since the earlier of the two must show the same by itself.
void LoopSearch::Confirm(const Trail& trail, const PosePath& path) {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const std::size_t now = shapes.size() - 1;
  const LoopClosure closure = SeenFrom(now, unconfirmed_.back(), shapes);
  const LoopClosure* const earlier = Earlier(closure, shapes);
  if (earlier == nullptr) return GoToNextCandidate();
  const Pose2 guess = Between(path[closure.old], path[now]);
  comparison_ = {closure.old, now, earlier->recent + 1, guess, trail.distances_m()[closure.old]};
}

const LoopClosure* LoopSearch::Earlier(const LoopClosure& closure, std::span<const KeyframeShape> shapes) const {
  for (const LoopClosure& earlier : unconfirmed_) {
    if (shapes[earlier.recent].travelled_m >= searched_at_m_) break;
    if (shapes[closure.recent].travelled_m - shapes[earlier.recent].travelled_m < options_.confirm_after_m) continue;
    if (Agree(earlier, closure, shapes)) return &earlier;  // The earliest one, since which the robot has seen the most.
  }
  return nullptr;
}

void LoopSearch::ForgetUnconfirmed() {
  unconfirmed_.clear();
  due_ = Due::kNothing;
  comparison_.reset();
  match_.reset();
}

LoopClosure LoopSearch::SeenFrom(std::size_t keyframe, const LoopClosure& closure,
                                 std::span<const KeyframeShape> shapes) {
  const Pose2 step = Between(shapes[closure.recent].T_track_robot, shapes[keyframe].T_track_robot);
  return {closure.old, keyframe, closure.T_old_recent * step, closure.covariance};
}

void LoopSearch::Retire(const Retirement& retirement) {
  const auto stays = [&](const LoopClosure& one) {
    return retirement.IsKept(one.old) && retirement.IsKept(one.recent);
  };
  // What is due with the last loop found cannot be done without it.
  const bool of_found = due_ == Due::kConfirm || due_ == Due::kClose;
  if (comparison_ || (of_found && !stays(unconfirmed_.back()))) due_ = Due::kNothing;
  comparison_.reset();  // Its stretches are no longer what they were.
  match_.reset();
  std::erase_if(unconfirmed_, [&](const LoopClosure& one) { return !stays(one); });
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
