#include "server/slam/matching/self_check.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

constexpr std::size_t kMaxWitnesses = 3;
constexpr std::size_t kMinLooks = 5;    // Of a stretch, for a verdict.
constexpr std::size_t kMaxLooks = 500;  // Who turns on the spot looks often without travelling.
constexpr int kMinKnown = 20;           // Points compared, for a look to count.
constexpr double kTurnCostM = 1.0;      // Per radian: who looks elsewhere sees less in common.
constexpr double kSamePlaceM = 3.0;     // Of way, between two witnesses.

}  // namespace

void Visit(OptionVisitor& visitor, SelfCheckOptions& options) {
  visitor.Flag("enabled", options.enabled, "Compare scans with the map drawn at earlier visits.");
  visitor.Real("min_travel_m", options.min_travel_m, "m", 0.0, 1000.0,
               "Between the sightings compared; less: both may have drifted alike.");
  visitor.Real("max_distance_m", options.max_distance_m, "m", 0.1, 50.0, "Between the robot and an old keyframe.");
  visitor.Real("every_m", options.every_m, "m", 0.0, 100.0, "Travelled between looks; smaller: sooner, slower.");
  visitor.Real("stretch_m", options.stretch_m, "m", 0.5, 100.0, "Way the verdict is about; longer: surer, later.");
  visitor.Real("near_m", options.near_m, "m", 0.02, 5.0,
               "Poses and points may be wrong by this; walls doubled by less are not noticed.");
  visitor.Real("max_range_m", options.max_range_m, "m", 1.0, 100.0, "Farther points are not compared.");
  visitor.Real("max_conflict", options.max_conflict, "1", 0.05, 1.0,
               "Share of contradictions above which the pose is wrong; below half of it, right again.");
}

void SelfCheck::Look(std::span<const Keyframe> keyframes, std::span<const KeyframeShape> shapes,
                     const SharedSequence<Pose2>& path) {
  const double here_m = shapes.back().travelled_m;
  // A stretch must have room for the looks a verdict takes.
  const double every_m = std::min(options_.every_m, options_.stretch_m / static_cast<double>(kMinLooks));
  if (!options_.enabled || here_m - looked_at_m_ < every_m) return;
  looked_at_m_ = here_m;
  const std::size_t now = shapes.size() - 1;
  Looked look{here_m, {}};
  for (const std::size_t old : Witnesses(shapes, path)) {
    const Pose2 T_old_now = Between(path[old], path[now]);
    look.testimony +=
        Testify(*keyframes[old].scan, T_old_now, shapes[now].points, options_.near_m, options_.max_range_m);
    look.testimony +=
        Testify(*keyframes[now].scan, T_old_now.Inverse(), shapes[old].points, options_.near_m, options_.max_range_m);
  }
  if (look.testimony.known() < kMinKnown) return;
  looks_.push_back(look);
  Judge();
}

void SelfCheck::Forget() {
  looks_.clear();
  contradicted_ = false;
}

// Old keyframes near where the robot believes to be, the ones that see most in common with it first, not two of one
// place and visit.
std::vector<std::size_t> SelfCheck::Witnesses(std::span<const KeyframeShape> shapes,
                                              const SharedSequence<Pose2>& path) const {
  struct Candidate {
    std::size_t keyframe;
    double cost_m;
  };
  std::vector<Candidate> all;
  const KeyframeShape& last = shapes.back();
  const Pose2 here = path[shapes.size() - 1];
  for (std::size_t k = 0; k < shapes.size() && last.travelled_m - shapes[k].travelled_m >= options_.min_travel_m; ++k) {
    const Pose2& there = path[k];
    const double distance_m = (there.translation() - here.translation()).norm();
    if (distance_m > options_.max_distance_m) continue;
    all.push_back({k, distance_m + kTurnCostM * std::abs(AngleDiff(there.theta, here.theta))});
  }
  std::stable_sort(all.begin(), all.end(), [](const Candidate& a, const Candidate& b) { return a.cost_m < b.cost_m; });
  std::vector<std::size_t> chosen;
  for (const Candidate& candidate : all) {
    const bool same_place = std::any_of(chosen.begin(), chosen.end(), [&](std::size_t other) {
      return std::abs(shapes[candidate.keyframe].travelled_m - shapes[other].travelled_m) < kSamePlaceM;
    });
    if (!same_place) chosen.push_back(candidate.keyframe);
    if (chosen.size() == kMaxWitnesses) break;
  }
  return chosen;
}

void SelfCheck::Judge() {
  while (looks_.back().travelled_m - looks_.front().travelled_m > options_.stretch_m || looks_.size() > kMaxLooks)
    looks_.pop_front();
  if (looks_.size() < kMinLooks) return;
  Testimony sum;
  for (const Looked& look : looks_) sum += look.testimony;
  const double conflict = static_cast<double>(sum.contradicted) / static_cast<double>(sum.known());
  contradicted_ = conflict > (contradicted_ ? 0.5 : 1.0) * options_.max_conflict;
}

}  // namespace cairn::slam
