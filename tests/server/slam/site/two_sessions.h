// Two sessions of one building without errors of their paths, for tests of what the joint smoothing consists of.
#pragma once

#include <memory>
#include <vector>

#include "server/slam/site/relation_search.h"
#include "tests/server/slam/site/site_drives.h"

namespace cairn::slam::test {

struct TestSession {
  // Its number among the sessions; its id is one more.
  TestSession(std::size_t its_number, RobotDrive driven)
      : number(its_number),
        drive(std::move(driven)),
        map(std::make_unique<SessionMap>(its_number + 1, drive.snapshot, drive.snapshot.full_path,
                                         SiteOptionsOf(MapperOptions{}))) {
    Place({});
  }

  // Where the session is believed to lie: at its true poses, but for an error.
  void Place(const Pose2& error) {
    path = {};
    for (const Pose2& pose : drive.truth) path.Append(error * pose);
  }
  [[nodiscard]] PlacedSession placed() const { return {number, *map, path}; }

  std::size_t number;
  RobotDrive drive;
  std::unique_ptr<SessionMap> map;
  PosePath path;
};

// From `from_m` on round the ring; its own map begins at `T_own_start`.
inline TestSession RingSession(std::size_t number, const World& world, double from_m, double metres,
                               const Pose2& T_own_start) {
  constexpr double kStepM = 0.4;
  const std::vector<Pose2> before = RingSteps(from_m, kStepM), all = RingSteps(from_m + metres, kStepM);
  Pose2 T_world_start;
  for (const Pose2& step : before) T_world_start = T_world_start * step;
  return {number,
          DriveThrough(world, T_world_start, std::span(all).subspan(before.size()), T_own_start, number + 1, 0)};
}

// By how much a relation is wrong (m).
inline double ErrorOfRelation(const SessionRelation& relation, const TestSession& from, const TestSession& to) {
  const Pose2 truth = Between(from.drive.truth[relation.from.keyframe], to.drive.truth[relation.to.keyframe]);
  return (truth.translation() - relation.T_from_to.translation()).norm();
}

}  // namespace cairn::slam::test
