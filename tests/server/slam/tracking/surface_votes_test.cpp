#include "server/slam/tracking/surface_votes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/slam/methods.h"
#include "server/slam/tracking/front_end.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

using Points = std::vector<SurfacePoint>;

// A face across the corridor, towards the robot.
void AddFace(double x, double y_min, double y_max, Points& points) {
  for (double y = y_min; y < y_max + 1e-9; y += 0.05) points.push_back({{x, y}, {-1.0, 0.0}});
}

void AddWalls(Points& points) {
  for (double x = 0.5; x < 8.0; x += 0.1) points.push_back({{x, 1.2}, {0.0, -1.0}});
  for (double x = 0.5; x < 8.0; x += 0.1) points.push_back({{x, -1.2}, {0.0, 1.0}});
}

Points MovedBack(Points points, double way_m) {
  for (SurfacePoint& point : points) point.p.x() -= way_m;
  return points;
}

// Votes for standing still, where the robot has driven 0.1 m and something before it as well.
int VotesForStandingStill(const Points& standing) {
  Points reference = standing;
  AddFace(1.2, -0.2, 0.2, reference);
  Points seen = MovedBack(standing, 0.1);
  AddFace(1.2, -0.2, 0.2, seen);
  return SurfaceVotes(seen, PointIndex(reference), {0.1, 0.0, 0.0}, {});
}

TEST(SurfaceVotes, WhatMovesAlongIsOneSurfaceAndWallsAlongTheWayAreNone) {
  Points corridor;
  AddWalls(corridor);
  EXPECT_EQ(VotesForStandingStill(corridor), 1);
}

TEST(SurfaceVotes, EachSurfaceCountsOnceHoweverFewPointsItHas) {
  Points corridor;
  AddWalls(corridor);
  for (const double x : {2.0, 5.0, 8.0}) AddFace(x, 1.0, 1.1, corridor);
  EXPECT_EQ(VotesForStandingStill(corridor), 1 - 3);
}

TEST(SurfaceVotes, AWideSurfaceCountsTwice) {
  Points corridor;
  AddWalls(corridor);
  AddFace(7.0, -1.2, 1.2, corridor);
  EXPECT_EQ(VotesForStandingStill(corridor), 1 - 2);
}

// How far the path of a robot is from the truth after 30 m along a corridor, where another robot drives `ahead_m`
// before it (nobody, if 0). From scan to scan it drives `step_m`.
double ErrorBehind(double ahead_m, double step_m = 0.1) {
  const FrontEndOptions options;
  FrontEnd front_end(options, MakeMatcher(MatcherKind::kVoting, {}), {});
  const test::World corridor = test::RingCorridor(true);
  const test::Laser laser{.range_max_m = 12.0, .sigma_m = 0.01};
  std::mt19937_64 rng(1);
  Pose2 truth, odometry, track;
  const int keyframe_each = static_cast<int>(std::lround(0.3 / step_m));
  int scans = 0;
  for (const Pose2& step : test::RingSteps(30.0, step_m)) {
    test::World world = corridor;
    if (ahead_m > 0.0) {
      std::vector<Eigen::Vector2d> ring;
      for (int i = 0; i <= 16; ++i)
        ring.push_back(truth * Eigen::Vector2d(ahead_m + 0.25 * std::cos(i * kPi / 8), 0.25 * std::sin(i * kPi / 8)));
      world.Add(ring);
    }
    const ScanView view = Look(test::Look(world, truth, laser, &rng), options);
    track = front_end.Track(view, odometry, SerialFor).T_track_robot;
    if (scans++ % keyframe_each == 0) front_end.AddKeyframe(view);
    truth = truth * step;
    odometry = odometry * step;
  }
  const std::vector<Pose2> steps = test::RingSteps(30.0, step_m);
  return (track.translation() - (truth * steps.back().Inverse()).translation()).norm();
}

// Its scans stand still before the robot, and it stood still with them.
TEST(FrontEnd, FollowsTheWallsAndNotARobotThatDrivesAhead) {
  EXPECT_LT(ErrorBehind(0.0), 0.1);
  EXPECT_LT(ErrorBehind(0.8), 1.5);  // Before there were votes it stayed behind by 24 m.
}

// A fast lidar on a slow robot.
TEST(FrontEnd, FollowsTheWallsHoweverShortTheStepBetweenTwoScansIs) {
  EXPECT_LT(ErrorBehind(0.8, 0.025), 1.5);
}

}  // namespace
}  // namespace cairn::slam
