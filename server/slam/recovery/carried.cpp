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
// A scan of a robot that was carried shows at least so much of both (`cairn-study moved --only kidnapped`). Scans of
// robots that were not carried seldom do; most that do are taken among people.
constexpr double kLeastDrop = 0.06;
constexpr double kLeastRise = 0.02;
// Where much is contradicted already, as among people, the conflict must also be so many times as large.
constexpr double kTimes = 2.0;
// The doubt ends below this share of kLeastRise, so that it does not begin again with the next scan.
constexpr double kEnded = 0.5;
// Where something moves, the scans since then contradict each other by more than this, and by more than this share of
// the rise; where the robot was carried, nothing contradicts but noise.
constexpr double kLeastMoving = 0.015;
constexpr double kMovingShare = 0.25;

bool IsKnown(const VisibilityCounts& counts) {
  return counts.known() >= kLeastKnown;
}

double ConflictOf(const VisibilityCounts& counts) {
  return !IsKnown(counts) ? 0.0 : static_cast<double>(counts.contradicted) / counts.known();
}

double ConflictOfStep(const SeenScan& last, const SeenScan& now) {
  return ConflictOf(CompareBothWays(last.scan, last.points_robot, now.scan, now.points_robot,
                                    Between(last.T_track_robot, now.T_track_robot), kNearM));
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
  return {seen.score, ConflictOf(counts), IsKnown(counts)};
}

bool MayBeCarried(double before, double score) {
  return before - score > kLeastDrop;
}

bool LooksCarried(const Trail& trail, const SeenScan& last, const SceneAgreement& before, const SeenScan& now) {
  if (!MayBeCarried(before.score, now.score)) return false;
  return ConflictOfStep(last, now) > kLeastRise &&
         AgreementWithLast(trail, now).conflict > kTimes * before.conflict + kLeastRise;
}

SceneAgreement AgreementWithMap(const FollowedMap& followed, const SeenScan& seen) {
  const VisibilityCounts counts =
      followed.map.Compare(seen.scan, seen.points_robot, followed.T_map_track * seen.T_track_robot);
  return {seen.score, ConflictOf(counts), IsKnown(counts)};
}

bool LooksCarried(const FollowedMap& followed, const SeenScan& last, const SceneAgreement& before,
                  const SeenScan& now) {
  if (!MayBeCarried(before.score, now.score) || ConflictOfStep(last, now) <= kLeastRise) return false;
  const SceneAgreement after = AgreementWithMap(followed, now);
  // Where the map shows nothing, the robot may have been carried out of it.
  return after.known ? after.conflict > kTimes * before.conflict + kLeastRise : before.known;
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
  if (!now.known) return true;  // Nothing tells that it is where it was.
  const double rise = now.conflict - before.conflict;
  return rise > kEnded * kLeastRise && since < std::max(kLeastMoving, kMovingShare * rise);
}

}  // namespace cairn::slam
