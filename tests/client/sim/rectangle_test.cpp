#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "client/sim/rectangle_tree.h"
#include "client/sim/scene.h"
#include "common/geometry/angle.h"

namespace cairn::sim {
namespace {

const Rectangle kWall{{2, -1, 0}, {0, 2, 0}, {0, 0, 3}};  // At x = 2, y -1..1, z 0..3.

TEST(Rectangle, RaysEndOnIt) {
  EXPECT_NEAR(CastAtRectangle(kWall, {0, 0, 1}, {1, 0, 0}), 2.0, 1e-15);
  const Eigen::Vector3d slant = Eigen::Vector3d(2, 0.5, 1.5).normalized();
  EXPECT_NEAR(CastAtRectangle(kWall, {0, 0, 1}, slant), Eigen::Vector3d(2, 0.5, 1.5).norm(), 1e-14);
  EXPECT_NEAR(CastAtRectangle(kWall, {5, 0, 1}, {-1, 0, 0}), 3.0, 1e-15) << "both sides stop a ray";
}

TEST(Rectangle, RaysMissBesideBehindAndAlong) {
  EXPECT_EQ(CastAtRectangle(kWall, {0, 1.01, 1}, {1, 0, 0}), kNothingHit);
  EXPECT_EQ(CastAtRectangle(kWall, {0, 0, 3.01}, {1, 0, 0}), kNothingHit);
  EXPECT_EQ(CastAtRectangle(kWall, {0, 0, 1}, {-1, 0, 0}), kNothingHit);
  EXPECT_EQ(CastAtRectangle(kWall, {2, 0, -1}, {0, 0, 1}), kNothingHit);
  EXPECT_NEAR(CastAtRectangle(kWall, {0, 1, 3}, {1, 0, 0}), 2.0, 1e-15) << "the corner counts";
}

TEST(Rectangle, DistanceIsToTheNearestPoint) {
  EXPECT_NEAR(DistanceTo(kWall, {0, 0, 1}), 2.0, 1e-15);
  EXPECT_NEAR(DistanceTo(kWall, {2, 0.3, 2}), 0.0, 1e-15);
  EXPECT_NEAR(DistanceTo(kWall, {2, 4, 7}), 5.0, 1e-15);  // Corner (2, 1, 3).
}

std::vector<Rectangle> Clutter(int count, std::mt19937_64& engine) {
  std::uniform_real_distribution<double> uniform(-10.0, 10.0);
  std::vector<Rectangle> rectangles;
  while (static_cast<int>(rectangles.size()) < count) {
    const Eigen::Vector3d a(uniform(engine), uniform(engine), uniform(engine));
    const Eigen::Vector3d b(uniform(engine), uniform(engine), uniform(engine));
    const Eigen::Vector3d side = 0.2 * a, other = 0.2 * a.cross(b).normalized() * std::abs(uniform(engine));
    rectangles.push_back({{uniform(engine), uniform(engine), uniform(engine)}, side, other});
  }
  return rectangles;
}

TEST(RectangleTree, AnswersWhatTryingAllWould) {
  std::mt19937_64 engine(3);
  std::uniform_real_distribution<double> uniform(-12.0, 12.0);
  for (const int count : {1, 4, 5, 60, 700}) {
    const std::vector<Rectangle> all = Clutter(count, engine);
    const RectangleTree tree(all);
    int hits = 0;
    for (int i = 0; i < 400; ++i) {
      const Eigen::Vector3d origin(uniform(engine), uniform(engine), uniform(engine));
      Eigen::Vector3d direction(uniform(engine), uniform(engine), i % 4 == 0 ? 0.0 : uniform(engine));
      direction.normalize();
      double range = kNothingHit, distance = kNothingHit;
      for (const Rectangle& r : all) {
        range = std::min(range, CastAtRectangle(r, origin, direction));
        distance = std::min(distance, DistanceTo(r, origin));
      }
      EXPECT_EQ(tree.Cast(origin, direction, 100.0), range);
      EXPECT_EQ(tree.Cast(origin, direction, range * 0.99), kNothingHit) << "not beyond the limit";
      EXPECT_NEAR(tree.Distance(origin), distance, 1e-12);
      hits += range < kNothingHit;
    }
    EXPECT_TRUE(count < 700 || hits > 100) << hits;
  }
}

TEST(RectangleTree, NothingIsHitInAnEmptyWorld) {
  const RectangleTree tree({});
  EXPECT_EQ(tree.Cast({0, 0, 0}, {1, 0, 0}, 10.0), kNothingHit);
  EXPECT_EQ(tree.Distance({0, 0, 0}), kNothingHit);
}

TEST(FlatScene, WallsRiseForEver) {
  const RayCaster walls({{{3, -5}, {3, 5}}});
  const FlatScene scene(walls);
  EXPECT_NEAR(scene.Cast({0, 0, 0.4}, {1, 0, 0}, 10.0), 3.0, 1e-12);
  const double up = Radians(50.0);
  EXPECT_NEAR(scene.Cast({0, 0, 0.4}, {std::cos(up), 0, std::sin(up)}, 10.0), 3.0 / std::cos(up), 1e-12);
  EXPECT_EQ(scene.Cast({0, 0, 0.4}, {std::cos(up), 0, std::sin(up)}, 4.0), kNothingHit);
  EXPECT_EQ(scene.Cast({0, 0, 0.4}, {0, 0, -1}, 10.0), kNothingHit) << "there is no floor";
}

TEST(Post, HasASideATopAndAnEnd) {
  const Post post{{{2, 0}, 0.5}, 1.0};
  EXPECT_NEAR(CastAtPost(post, {0, 0, 0.4}, {1, 0, 0}), 1.5, 1e-12);
  EXPECT_EQ(CastAtPost(post, {0, 0, 1.2}, {1, 0, 0}), kNothingHit);
  const Eigen::Vector3d down = Eigen::Vector3d(2, 0, -2).normalized();
  EXPECT_NEAR(CastAtPost(post, {0, 0, 3}, down), std::sqrt(8.0), 1e-12) << "lands on the top";
  EXPECT_NEAR(CastAtPost({{{2, 0}, 0.5}}, {0, 0, 50}, {1, 0, 0}), 1.5, 1e-12) << "a flat world's disc has no top";
}

}  // namespace
}  // namespace cairn::sim
