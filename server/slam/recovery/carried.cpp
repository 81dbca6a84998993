#include "server/slam/recovery/carried.h"

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "server/slam/loops/visibility.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kLastKeyframes = 3;
constexpr double kApartM = 0.3;  // Way between two of them.
// As fine as matched scans agree: a doorway of another depth is a contradiction.
constexpr double kNearM = 0.12;
constexpr double kMostM = 10.0;  // Farther points are not compared, as in CompareBothWays.
constexpr int kLeastKnown = 20;  // Points that must be compared for a comparison to count.
// A scan of a robot that was carried shows at least so much of both (`cairn-study moved --only kidnapped`). Scans of
// robots that were not carried seldom do; most that do are taken among people.
constexpr double kLeastDrop = 0.06;
constexpr double kLeastRise = 0.02;
// Where much is contradicted already, as among people, the conflict must also be so many times as large.
constexpr double kTimes = 2.0;
// Of one thing that has changed, as a door, a wall that was put up or a person, each point lies so near to another one.
constexpr double kOneThingM = 1.0;
// Where the robot was carried, more than this share of what is compared is contradicted beside the largest thing that
// has changed: 1.4 % and more (`cairn-study moved --only kidnapped`). Where it drives past doors that open and close it
// is 0.1 % at most (`cairn-study furniture --only doors`).
constexpr double kLeastElsewhere = 0.01;
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

// Calls `add` with some of the last keyframes of the trail: the scan, its surfaces, and where it was seen in `track`.
template <typename Add>
void ForEachLast(const Trail& trail, const SeenScan& seen, const Add& add) {
  const auto shapes = trail.shapes();
  double apart_m = 0.0;
  std::size_t compared = 0;
  for (std::size_t k = trail.size(); k-- > 0 && compared < kLastKeyframes;) {
    const double way_m = shapes.back().travelled_m - shapes[k].travelled_m;
    const Scan& keyframe = *trail.keyframes()[k].scan;
    if (way_m < apart_m || keyframe.stamp == seen.scan.stamp) continue;
    apart_m = way_m + kApartM;
    ++compared;
    add(keyframe, *trail.points(k), shapes[k].T_track_robot);
  }
}

// What two scans contradict of each other.
struct Contradictions {
  std::vector<Eigen::Vector2d> places_track;
  int known = 0;

  void AddBothWays(const SeenScan& a, const SeenScan& b) {
    Add(a, b);
    Add(b, a);
  }
  // The points of `of` that `by` contradicts.
  void Add(const SeenScan& by, const SeenScan& of) {
    const Pose2 T_by_of = Between(by.T_track_robot, of.T_track_robot);
    for (const SurfacePoint& point : of.points_robot) {
      const VisibilityCounts counts = CompareVisibility(by.scan, T_by_of, std::span(&point, 1), kNearM, kMostM);
      known += counts.known();
      if (counts.contradicted > 0) places_track.push_back(of.T_track_robot * point.p);
    }
  }
  // Without those of the largest thing: whether there are many.
  [[nodiscard]] bool AreAtSeveralPlaces() const {
    std::vector<Eigen::Vector2d> left = places_track;
    std::size_t most = 0;
    while (!left.empty()) {
      std::vector<Eigen::Vector2d> thing = {left.back()};
      left.pop_back();
      for (std::size_t i = 0; i < thing.size(); ++i) {
        const auto apart = [&thing, i](const Eigen::Vector2d& p) { return (p - thing[i]).norm() > kOneThingM; };
        const auto near = std::partition(left.begin(), left.end(), apart);
        thing.insert(thing.end(), near, left.end());
        left.erase(near, left.end());
      }
      most = std::max(most, thing.size());
    }
    return static_cast<double>(places_track.size() - most) > kLeastElsewhere * known;
  }
};

double ConflictOfStep(const SeenScan& last, const SeenScan& now) {
  return ConflictOf(CompareBothWays(last.scan, last.points_robot, now.scan, now.points_robot,
                                    Between(last.T_track_robot, now.T_track_robot), kNearM));
}

}  // namespace

SceneAgreement AgreementWithLast(const Trail& trail, const SeenScan& seen) {
  VisibilityCounts counts;
  ForEachLast(trail, seen, [&](const Scan& scan, const std::vector<SurfacePoint>& points, const Pose2& T_track_robot) {
    counts +=
        CompareBothWays(scan, points, seen.scan, seen.points_robot, Between(T_track_robot, seen.T_track_robot), kNearM);
  });
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

bool DiffersAtSeveralPlaces(const Trail& trail, const SeenScan& now) {
  Contradictions all;
  ForEachLast(trail, now, [&](const Scan& scan, const std::vector<SurfacePoint>& points, const Pose2& T_track_robot) {
    all.AddBothWays({scan, points, T_track_robot, 0.0}, now);
  });
  return all.AreAtSeveralPlaces();
}

bool DiffersAtSeveralPlaces(const SeenScan& last, const SeenScan& now) {
  Contradictions all;
  all.AddBothWays(last, now);
  return all.AreAtSeveralPlaces();
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
