#include "server/slam/loops/visibility.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::Look;

constexpr double kNearM = 0.25, kMaxRangeM = 10.0;

std::vector<SurfacePoint> SurfacesOf(const Scan& scan) {
  return SurfacePointsOf(PointsOf(scan), scan, {});
}

VisibilityCounts CountsOf(const Scan& scan, const Eigen::Vector2d& p_robot) {
  const std::vector<SurfacePoint> points{{p_robot, Eigen::Vector2d::Zero()}};
  return CompareVisibility(scan, {}, points, kNearM, kMaxRangeM);
}

// A wall 4 m ahead, across the whole view; nothing to the sides beyond it.
Scan WallAhead() {
  test::World world;
  world.Add({{4, -50}, {4, 50}});
  return Look(world, {}, Laser{});
}

TEST(Visibility, ConfirmsContradictsOrDoesNotKnow) {
  const Scan scan = WallAhead();
  EXPECT_EQ(CountsOf(scan, {4.1, 0.3}).confirmed, 1);
  EXPECT_EQ(CountsOf(scan, {3.0, 0.3}).contradicted, 1);  // Beams went through there.
  EXPECT_EQ(CountsOf(scan, {5.0, 0.3}).known(), 0);       // Behind the wall.
  EXPECT_EQ(CountsOf(scan, {-1.0, 0.0}).known(), 0);      // Behind the scanner, which sees half a turn.
  EXPECT_EQ(CountsOf(scan, {0.1, 0.0}).known(), 0);       // Within the robot's own uncertainty.
}

// Dark surfaces and glass give no return either.
TEST(Visibility, BeamsWithoutReturnKnowNothing) {
  Scan scan = WallAhead();
  for (float& range : scan.ranges_m) range = std::numeric_limits<float>::infinity();
  EXPECT_EQ(CountsOf(scan, {3.0, 0.0}).known(), 0);
  for (float& range : scan.ranges_m) range = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(CountsOf(scan, {3.0, 0.0}).known(), 0);
}

// A point near the edge of a nearer object: some of the beams around it pass the object, others do not.
TEST(Visibility, DoesNotKnowAtTheEdgeOfAThing) {
  test::World world;
  world.Add({{6, -50}, {6, 50}}).Add({{2, 0}, {2, 3}});
  const Scan scan = Look(world, {}, Laser{});
  EXPECT_EQ(CountsOf(scan, {4.0, -0.1}).known(), 0);
  EXPECT_EQ(CountsOf(scan, {4.0, -1.0}).contradicted, 1);
}

// For every mounting and sense of rotation, two scans of one world confirm each other at the true poses, and
// contradict each other if one pose is wrong by 0.6 m.
TEST(Visibility, ScansOfOneWorldAgreeAtTheTruePosesOnly) {
  const Pose2 T_world_a{-1.0, 0.2, 0.3}, T_world_b{0.6, 0.9, -0.2};
  const Laser clockwise{.beams = 541, .first_rad = 2.3, .step_rad = -Radians(0.5), .T_robot_laser = {0.2, -0.1, 0.4}};
  for (const Laser& laser : {test::FullTurnLaser(), Laser{}, clockwise}) {
    const Scan a = Look(test::Office(), T_world_a, laser), b = Look(test::Office(), T_world_b, laser);
    const Pose2 T_a_b = Between(T_world_a, T_world_b);
    VisibilityCounts right = CompareVisibility(a, T_a_b, SurfacesOf(b), kNearM, kMaxRangeM);
    right += CompareVisibility(b, T_a_b.Inverse(), SurfacesOf(a), kNearM, kMaxRangeM);
    EXPECT_GT(right.confirmed, 100);
    EXPECT_EQ(right.contradicted, 0);
    const Pose2 T_a_off = T_a_b * Pose2{0.5, 0.35, 0.0};
    VisibilityCounts wrong = CompareVisibility(a, T_a_off, SurfacesOf(b), kNearM, kMaxRangeM);
    wrong += CompareVisibility(b, T_a_off.Inverse(), SurfacesOf(a), kNearM, kMaxRangeM);
    EXPECT_GT(wrong.contradicted, wrong.known() / 4);
  }
}

}  // namespace
}  // namespace cairn::slam
