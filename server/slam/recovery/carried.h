// Notices that somebody has carried the robot between two scans, although nothing is missing in what it sends (the
// kidnapped robot). Such a scan is explained suddenly less by the surfaces of the last keyframes than the scan before,
// and it contradicts them more: either shows surfaces where beams of the other passed. What passes close to the lidar
// looks so for a moment, but then the next scans are again as those before. So the robot is doubted first, and has been
// carried if it stays so. It cannot notice a robot that is carried to a place where all that it sees looks the same,
// for example along a corridor without doors. A door that somebody has opened or closed looks like it as well, but only
// at one place. Frames: `track` is that of the front-end. Stateless, thread-safe.
#pragma once

#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "server/slam/recovery/place_search.h"
#include "server/slam/recovery/searched_map.h"
#include "server/slam/scan/surface_points.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

// How far a robot that is doubted is followed before it counts as carried.
inline constexpr double kMostDoubtedM = 1.0;
// How far it is looked for then, where it is not likely that it was carried.
inline constexpr double kDoubtedInVainM = 12.0;

// How a scan agrees with the last keyframes where the robot is believed to be.
struct SceneAgreement {
  double score = 0.0;     // TrackStep::score.
  double conflict = 0.0;  // Share of the points compared that are contradicted.
  bool known = true;      // Whether there were enough points to compare. Not stored.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.score, self.conflict);
  }
};

// A scan, seen at `T_track_robot`.
struct SeenScan {
  const Scan& scan;
  const std::vector<SurfacePoint>& points_robot;
  Pose2 T_track_robot;
  double score = 0.0;
};

// How a scan agrees with the last keyframes of the trail.
[[nodiscard]] SceneAgreement AgreementWithLast(const Trail& trail, const SeenScan& seen);
// Whether the score alone may show that the robot was carried after a scan with score `before`: it costs nothing.
[[nodiscard]] bool MayBeCarried(double before, double score);
// Whether `now`, which comes after `last`, may show that the robot was carried between the two. `before` is the
// agreement of `last`.
[[nodiscard]] bool LooksCarried(const Trail& trail, const SeenScan& last, const SceneAgreement& before,
                                const SeenScan& now);
// Whether what contradicts between `now` and the last keyframes, or the last scan, lies at several places: then it is
// likely that the robot was carried, because one door or one piece of furniture that has moved does not explain it.
[[nodiscard]] bool DiffersAtSeveralPlaces(const Trail& trail, const SeenScan& now);
[[nodiscard]] bool DiffersAtSeveralPlaces(const SeenScan& last, const SeenScan& now);
// The map of others in which a robot is followed that has no last keyframes, and where its track lies in it.
struct FollowedMap {
  const SearchedMap& map;
  Pose2 T_map_track;
};
// How a scan agrees with that map, and the same question with it.
[[nodiscard]] SceneAgreement AgreementWithMap(const FollowedMap& followed, const SeenScan& seen);
[[nodiscard]] bool LooksCarried(const FollowedMap& followed, const SeenScan& last, const SceneAgreement& before,
                                const SeenScan& now);
// The share of the points compared that are contradicted between a scan and earlier ones since the robot is doubted.
[[nodiscard]] double ConflictWith(std::span<const RecentScan> since, const SeenScan& now);
// Whether the scans of a doubted robot differ from the last keyframes but not from each other: then it is somewhere
// else. What moves past the robot contradicts the scans since then as well. `since`: ConflictWith.
[[nodiscard]] bool StaysDifferent(const SceneAgreement& before, const SceneAgreement& now, double since);

}  // namespace cairn::slam
