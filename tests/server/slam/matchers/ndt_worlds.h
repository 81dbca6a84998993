// Code that the tests of both NDT matchers share: a scan in the matchers' form, and the error of an answer.
#pragma once

#include <gtest/gtest.h>

#include <utility>

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

// What both matchers promise. `match_scans(prev, curr, prior)` returns a MatchResult.
template <typename MatchScans>
MatchResult ExpectACorridorIsFlagged(const MatchScans& match_scans) {
  const MatchPrior prior{{0.4, 0.0, 0.0}, Eigen::Vector3d(1e-3, 1e-3, 1e-3).asDiagonal()};
  const MatchResult match =
      match_scans(ViewFrom(LongCorridor(), {}), ViewFrom(LongCorridor(), {0.3, 0.05, 0.03}), prior);
  EXPECT_TRUE(match.converged);
  EXPECT_TRUE(match.degenerate);
  EXPECT_GT(std::abs(match.degenerate_direction.x()), 0.99);
  EXPECT_NEAR(match.T_ref_curr.y, 0.05, 0.01);
  EXPECT_NEAR(match.T_ref_curr.theta, 0.03, 0.005);
  return match;
}
template <typename MatchScans>
void ExpectWithoutPointsTheAnswerIsThePrior(const MatchScans& match_scans) {
  const MatchPrior prior = WidePrior({0.3, 0.2, 0.1});
  const ScanView office = ViewFrom(Office(), {}), empty;
  for (const auto& [prev, curr] : {std::pair{empty, office}, {office, empty}, {empty, empty}}) {
    const MatchResult match = match_scans(prev, curr, prior);
    EXPECT_FALSE(match.converged);
    EXPECT_EQ(match.failure, MatchFailure::kTooFewFeatures);
    EXPECT_EQ(match.T_ref_curr, prior.T_ref_curr);
    EXPECT_EQ(match.covariance, prior.covariance);
  }
}

}  // namespace cairn::slam::test
