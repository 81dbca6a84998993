#include "server/slam/loops/self_check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/loops/region.h"

namespace cairn::slam {
namespace {

// Half or twice of any of these changes the share of noticed errors by less than a tenth (study `sensitivity`).
constexpr std::size_t kMaxCompared = 3;
constexpr double kCompareEveryM = 0.5;      // Way between two comparisons.
constexpr double kCountedM = 5.0;           // Length of the path over which the comparisons are counted.
constexpr std::size_t kMinComparisons = 5;  // Comparisons of a stretch needed for a decision.
constexpr int kMinKnown = 20;               // Points that must be compared for a comparison to count.
constexpr double kTurnCostM = 1.0;          // Cost per radian: scans in other directions overlap less.
constexpr double kSamePlaceM = 3.0;         // Least distance along the path between two keyframes used.
constexpr std::size_t kMaxComparisons =
    500;  // Bound for a robot that turns on the spot and makes comparisons without travelling.

}  // namespace

void Visit(OptionVisitor& visitor, SelfCheckOptions& options) {
  visitor.Flag(
      "enabled", options.enabled,
      "Whether scans are compared with the map of earlier visits, and with the scan before to notice that somebody "
      "has carried the robot.");
  visitor.Real("min_travel_m", options.min_travel_m, "m", 0.0, 1000.0,
               "Way between the two visits that are compared. After a shorter way both may have the same drift.");
  visitor.Real(
      "near_m", options.near_m, "m", 0.02, 5.0,
      "Error of poses and points that is tolerated. Walls that are doubled by less are not noticed. With max_conflict "
      "it also counts when a robot that was not watched is looked for in its map; enabled does not.");
  visitor.Real("max_conflict", options.max_conflict, "1", 0.05, 1.0,
               "The pose counts as wrong when a larger share of the comparisons is a contradiction, and as right again "
               "below half of this.");
}

void SelfCheck::Look(const Trail& trail, const PathIndex& index) {
  const std::span<const Keyframe> keyframes = trail.keyframes();
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const double here_m = shapes.back().travelled_m;
  if (!options_.enabled || here_m - compared_at_m_ < kCompareEveryM) return;
  compared_at_m_ = here_m;
  const PosePath& path = index.path();
  const std::size_t now = shapes.size() - 1;
  Comparison comparison{here_m, {}};
  for (const std::size_t old : KeyframesToCompare(shapes, index)) {
    comparison.counts += CompareBothWays(*keyframes[old].scan, *trail.points(old), *keyframes[now].scan,
                                         *trail.points(now), Between(path[old], path[now]), options_.near_m);
  }
  if (comparison.counts.known() < kMinKnown) return;
  comparisons_.push_back(comparison);
  UpdateContradicted();
}

void SelfCheck::Forget() {
  comparisons_.clear();
  contradicted_ = false;
}

// Old keyframes near the believed pose, those with the most overlap first, and only one per place and visit.
std::vector<std::size_t> SelfCheck::KeyframesToCompare(std::span<const KeyframeShape> shapes,
                                                       const PathIndex& index) const {
  BestPlaces best(shapes, kSamePlaceM, kMaxCompared);
  const Pose2& here = index.path()[shapes.size() - 1];
  const std::size_t end = CountBefore(shapes, shapes.back().travelled_m, options_.min_travel_m);
  const auto look = [&](std::size_t k, const Pose2& there) {
    if (k >= end) return;
    const double distance_m = (there.translation() - here.translation()).norm();
    if (distance_m > kMaxVisibleM) return;
    best.Add({k, distance_m + kTurnCostM * std::abs(AngleDiff(there.theta, here.theta))});
  };
  // No keyframe costs less than its distance.
  const auto go_on = [&best](double distance_m) { return !best.Settle(distance_m); };
  index.ForEachFrom(here.translation(), kMaxVisibleM, go_on, look);
  return best.Take();
}

void SelfCheck::UpdateContradicted() {
  while (comparisons_.back().travelled_m - comparisons_.front().travelled_m > kCountedM ||
         comparisons_.size() > kMaxComparisons)
    comparisons_.pop_front();
  if (comparisons_.size() < kMinComparisons) return;
  VisibilityCounts sum;
  for (const Comparison& comparison : comparisons_) sum += comparison.counts;
  const double conflict = static_cast<double>(sum.contradicted) / static_cast<double>(sum.known());
  contradicted_ = conflict > (contradicted_ ? 0.5 : 1.0) * options_.max_conflict;
}

}  // namespace cairn::slam
