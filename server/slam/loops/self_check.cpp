#include "server/slam/loops/self_check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/loops/region.h"

namespace cairn::slam {
namespace {

// Half or twice of any of these changes the share of noticed errors by less than a tenth (study `sensitivity`).
constexpr std::size_t kMaxCompared = 3;
constexpr std::size_t kMinComparisons = 5;  // Comparisons of a stretch needed for a decision.
constexpr int kMinKnown = 20;               // Points that must be compared for a comparison to count.
constexpr double kTurnCostM = 1.0;          // Cost per radian: scans in other directions overlap less.
constexpr double kSamePlaceM = 3.0;         // Least distance along the path between two keyframes used.
constexpr std::size_t kMaxComparisons =
    500;  // Bound for a robot that turns on the spot and makes comparisons without travelling.

}  // namespace

void Visit(OptionVisitor& visitor, SelfCheckOptions& options) {
  visitor.Flag("enabled", options.enabled, "Whether scans are compared with the map of earlier visits.");
  visitor.Real("min_travel_m", options.min_travel_m, "m", 0.0, 1000.0,
               "Way between the two visits that are compared. After a shorter way both may have the same drift.");
  visitor.Real("max_distance_m", options.max_distance_m, "m", 0.1, 50.0,
               "Largest distance between the robot and an old keyframe. Larger values compare more and less reliably.");
  visitor.Real("every_m", options.every_m, "m", 0.0, 100.0,
               "Way between two comparisons. Smaller values notice errors sooner and take more time.");
  visitor.Real("stretch_m", options.stretch_m, "m", 0.5, 100.0,
               "Length of the path that is judged. Longer is more reliable and later.");
  visitor.Real("near_m", options.near_m, "m", 0.02, 5.0,
               "Error of poses and points that is tolerated. Walls that are doubled by less are not noticed.");
  visitor.Real("max_range_m", options.max_range_m, "m", 1.0, 100.0, "Points farther away are not compared.");
  visitor.Real("max_conflict", options.max_conflict, "1", 0.05, 1.0,
               "The pose counts as wrong when a larger share of the comparisons is a contradiction, and as right again "
               "below half of this.");
  visitor.Require(options.every_m <= options.stretch_m, "every_m", "must not exceed", "stretch_m");
}

void SelfCheck::Look(const Trail& trail, const SharedSequence<Pose2>& path) {
  const std::span<const Keyframe> keyframes = trail.keyframes();
  const std::span<const KeyframeShape> shapes = trail.shapes();
  const double here_m = shapes.back().travelled_m;
  // A stretch must contain enough comparisons for a decision.
  const double every_m = std::min(options_.every_m, options_.stretch_m / static_cast<double>(kMinComparisons));
  if (!options_.enabled || here_m - compared_at_m_ < every_m) return;
  compared_at_m_ = here_m;
  const std::size_t now = shapes.size() - 1;
  Comparison comparison{here_m, {}};
  for (const std::size_t old : KeyframesToCompare(shapes, path)) {
    const Pose2 T_old_now = Between(path[old], path[now]);
    comparison.counts +=
        CompareVisibility(*keyframes[old].scan, T_old_now, trail.points(now), options_.near_m, options_.max_range_m);
    comparison.counts += CompareVisibility(*keyframes[now].scan, T_old_now.Inverse(), trail.points(old),
                                           options_.near_m, options_.max_range_m);
  }
  if (comparison.counts.known() < kMinKnown) return;
  comparisons_.push_back(comparison);
  Judge();
}

void SelfCheck::Forget() {
  comparisons_.clear();
  contradicted_ = false;
}

// Old keyframes near the believed pose, those with the most overlap first, and only one per place and visit.
std::vector<std::size_t> SelfCheck::KeyframesToCompare(std::span<const KeyframeShape> shapes,
                                                       const SharedSequence<Pose2>& path) const {
  std::vector<KeyframeCost> all;
  const KeyframeShape& last = shapes.back();
  const Pose2 here = path[shapes.size() - 1];
  for (std::size_t k = 0; k < shapes.size() && last.travelled_m - shapes[k].travelled_m >= options_.min_travel_m; ++k) {
    const Pose2& there = path[k];
    const double distance_m = (there.translation() - here.translation()).norm();
    if (distance_m > options_.max_distance_m) continue;
    all.push_back({k, distance_m + kTurnCostM * std::abs(AngleDiff(there.theta, here.theta))});
  }
  return BestPlaces(std::move(all), shapes, kSamePlaceM, kMaxCompared);
}

void SelfCheck::Judge() {
  while (comparisons_.back().travelled_m - comparisons_.front().travelled_m > options_.stretch_m ||
         comparisons_.size() > kMaxComparisons)
    comparisons_.pop_front();
  if (comparisons_.size() < kMinComparisons) return;
  VisibilityCounts sum;
  for (const Comparison& comparison : comparisons_) sum += comparison.counts;
  const double conflict = static_cast<double>(sum.contradicted) / static_cast<double>(sum.known());
  contradicted_ = conflict > (contradicted_ ? 0.5 : 1.0) * options_.max_conflict;
}

}  // namespace cairn::slam
