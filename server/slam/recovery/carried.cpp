#include "server/slam/recovery/carried.h"

#include <algorithm>
#include <cstddef>

#include "server/slam/loops/visibility.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kLastKeyframes = 3;
constexpr double kApartM = 0.3;  // Way between two of them.
// As fine as matched scans agree: a doorway of another depth is a contradiction.
constexpr double kNearM = 0.12;
constexpr int kLeastKnown = 20;  // Points that must be compared for a comparison to count.
// In the worlds of the study `moved` one of a hundred robots that are carried shows less of either, if the scan is not
// the right one again. On the real logs, in which nobody is carried, one scan of two hundred shows more of both, nearly
// all of them among many people.
constexpr double kLeastDrop = 0.06;
constexpr double kLeastRise = 0.02;
// Scans since then contradict each other more than this, and by more than this share of the rise, where something
// moves: there a third of the rise and more, and less than a seventh of it where the robot was carried.
constexpr double kLeastMoving = 0.015;
constexpr double kMovingShare = 0.25;

double ConflictOf(const VisibilityCounts& counts) {
  return counts.known() < kLeastKnown ? 0.0 : static_cast<double>(counts.contradicted) / counts.known();
}

}  // namespace

SceneAgreement AgreementWithLast(const Trail& trail, const SeenScan& seen) {
  const auto shapes = trail.shapes();
  VisibilityCounts counts;
  double apart_m = 0.0;
  std::size_t compared = 0;
  for (std::size_t k = trail.size(); k-- > 0 && compared < kLastKeyframes;) {
    const double way_m = shapes.back().travelled_m - shapes[k].travelled_m;
    const Scan& keyframe = *trail.keyframes()[k].scan;
    if (way_m < apart_m || keyframe.stamp == seen.scan.stamp) continue;
    apart_m = way_m + kApartM;
    ++compared;
    counts += CompareBothWays(keyframe, *trail.points(k), seen.scan, seen.points_robot,
                              Between(shapes[k].T_track_robot, seen.T_track_robot), kNearM);
  }
  return {seen.score, ConflictOf(counts)};
}

bool MayBeCarried(double before, double score) {
  return before - score > kLeastDrop;
}

bool LooksCarried(const Trail& trail, const SeenScan& last, const SceneAgreement& before, const SeenScan& now) {
  if (!MayBeCarried(before.score, now.score)) return false;
  const VisibilityCounts step = CompareBothWays(last.scan, last.points_robot, now.scan, now.points_robot,
                                                Between(last.T_track_robot, now.T_track_robot), kNearM);
  return ConflictOf(step) > kLeastRise && AgreementWithLast(trail, now).conflict > 2.0 * before.conflict + kLeastRise;
}

bool IsExplainedAsBefore(const SceneAgreement& before, double score) {
  return score > before.score - 0.5 * kLeastDrop;
}

double ConflictWith(std::span<const RecentScan> since, const SeenScan& now) {
  VisibilityCounts counts;
  for (const RecentScan& one : since) {
    counts += CompareBothWays(*one.scan, one.points, now.scan, now.points_robot,
                              Between(one.T_track_robot, now.T_track_robot), kNearM);
  }
  return ConflictOf(counts);
}

bool StaysDifferent(const SceneAgreement& before, const SceneAgreement& now, double since) {
  const double rise = now.conflict - before.conflict;
  return rise > 0.5 * kLeastRise && since < std::max(kLeastMoving, kMovingShare * rise);
}

}  // namespace cairn::slam
