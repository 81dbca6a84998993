// Code that the tests of both NDT matchers share: a scan in the matchers' form, and the error of an answer.
#pragma once

#include "server/slam/tracking/front_end.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam::test {

inline const Laser kNdtLaser{.beams = 361, .step_rad = Radians(0.5)};

inline ScanView ViewFrom(const World& world, const Pose2& T_world_robot, const Laser& laser = kNdtLaser,
                         std::mt19937_64* engine = nullptr) {
  return Look(Look(world, T_world_robot, laser, engine), FrontEndOptions{});
}

// A prior that only limits the search and prefers no pose.
inline MatchPrior WidePrior(const Pose2& T_ref_curr = {}) {
  return {T_ref_curr, Eigen::Vector3d(1.0, 1.0, 0.5).asDiagonal()};
}

inline World LongCorridor() {
  World world;
  return world.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
}

inline World OneWall() {
  return World{}.Add({{-40, 1.5}, {40, 1.5}});
}

inline double OffsetOf(const MatchResult& match, const Pose2& truth) {
  return (match.T_ref_curr.translation() - truth.translation()).norm();
}
inline double TurnOf(const MatchResult& match, const Pose2& truth) {
  return std::abs(AngleDiff(match.T_ref_curr.theta, truth.theta));
}

}  // namespace cairn::slam::test
