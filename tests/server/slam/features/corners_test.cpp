#include "server/slam/features/corners.h"

#include <gtest/gtest.h>

#include "server/slam/features/feature_extraction.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::FullTurnLaser;
using test::Laser;
using test::Look;
using test::World;

std::vector<CornerFeature> RealCornersOf(const ScanFeatures& features) {
  std::vector<CornerFeature> real;
  for (const CornerFeature& corner : features.corners) {
    if (corner.real) real.push_back(corner);
  }
  return real;
}

TEST(Corners, AnInsideCornerTurnsLeftAndAnEdgeTurnsRight) {
  World inside, edge;
  inside.Add({{3, -2}, {3, 1}, {1, 1}});
  edge.Add({{4, -2.5}, {2.5, 0}, {4, 2.5}});
  const auto concave = RealCornersOf(ExtractFeatures(Look(inside, {}, Laser{}), {}));
  ASSERT_EQ(concave.size(), 1U);
  EXPECT_NEAR(concave[0].angle, kPi / 2, 1e-3);
  EXPECT_NEAR((concave[0].position - Eigen::Vector2d(3, 1)).norm(), 0.0, 1e-3);
  EXPECT_TRUE(concave[0].long_lines);
  const auto convex = RealCornersOf(ExtractFeatures(Look(edge, {}, Laser{}), {}));
  ASSERT_EQ(convex.size(), 1U);
  EXPECT_LT(convex[0].angle, 0.0);
  EXPECT_NEAR((convex[0].position - Eigen::Vector2d(2.5, 0)).norm(), 0.0, 1e-3);
}

TEST(Corners, ExtensionsMeetInAVirtualCorner) {
  World world;
  world.Add({{3, -2}, {3, 0.4}}).Add({{2.2, 1}, {0.8, 1}}).Add({{9, -9}, {9, 9}});
  const ScanFeatures features = ExtractFeatures(Look(world, {}, Laser{}), {});
  EXPECT_TRUE(RealCornersOf(features).empty());
  const bool found = std::any_of(features.corners.begin(), features.corners.end(), [](const CornerFeature& corner) {
    return (corner.position - Eigen::Vector2d(3, 1)).norm() < 1e-3;
  });
  EXPECT_TRUE(found);
}

TEST(Corners, ParallelLinesHaveNone) {
  World world;
  world.Add({{0, -1}, {6, -1}}).Add({{0, 1}, {6, 1}});
  EXPECT_TRUE(ExtractFeatures(Look(world, {}, Laser{}), {}).corners.empty());
}

TEST(Corners, ARoomSeenAllRoundHasFourRealOnes) {
  const ScanFeatures features = ExtractFeatures(Look(test::Room(-2, -3, 5, 7), {0, 0, 0.2}, FullTurnLaser()), {});
  const auto real = RealCornersOf(features);
  ASSERT_EQ(real.size(), 4U);
  for (const CornerFeature& corner : real) EXPECT_NEAR(corner.angle, kPi / 2, 1e-3);
  EXPECT_EQ(real.back().line_a, 3);  // Across the seam.
  EXPECT_EQ(real.back().line_b, 0);
}

TEST(Corners, ACornerDoesNotDependOnWhereTheRobotStands) {
  const World world = test::Office();
  const Pose2 a{0, 0, 0.2}, b{-0.4, 0.3, 0.5};
  const auto from_a = RealCornersOf(ExtractFeatures(Look(world, a, Laser{}), {}));
  const auto from_b = RealCornersOf(ExtractFeatures(Look(world, b, Laser{}), {}));
  int shared = 0;
  for (const CornerFeature& p : from_a) {
    for (const CornerFeature& q : from_b) {
      if ((a * p.position - b * q.position).norm() > 0.02) continue;
      ++shared;
      EXPECT_NEAR(std::abs(AngleDiff(p.angle, q.angle)), 0.0, Radians(1.0));
    }
  }
  EXPECT_GE(shared, 3);
}

}  // namespace
}  // namespace cairn::slam
