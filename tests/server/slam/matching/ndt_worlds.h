// What the tests of both NDT matchers share: a scan as the matchers see it, and how wrong an answer is.
#pragma once

#include "server/slam/front_end.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam::test {

inline const Laser kNdtLaser{.beams = 361, .step_rad = Radians(0.5)};

inline ScanView ViewFrom(const World& world, const Pose2& T_world_robot, const Laser& laser = kNdtLaser,
                         std::mt19937_64* engine = nullptr) {
  return Look(Look(world, T_world_robot, laser, engine), FrontEndOptions{});
}

// Nothing believed beforehand but about where to look.
inline MatchPrior WidePrior(const Pose2& T_prev_curr = {}) {
  return {T_prev_curr, Eigen::Vector3d(1.0, 1.0, 0.5).asDiagonal()};
}

inline World LongCorridor() {
  World world;
  return world.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
}

inline World OneWall() {
  return World{}.Add({{-40, 1.5}, {40, 1.5}});
}

inline double OffsetOf(const MatchResult& match, const Pose2& truth) {
  return (match.T_prev_curr.translation() - truth.translation()).norm();
}
inline double TurnOf(const MatchResult& match, const Pose2& truth) {
  return std::abs(AngleDiff(match.T_prev_curr.theta, truth.theta));
}

}  // namespace cairn::slam::test
