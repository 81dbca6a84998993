#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "common/geometry/angle.h"
#include "server/slam/dpslam/laser_rays.h"

namespace cairn::slam {
namespace {

struct CellOnRay {
  int x, y;
  double from, to;
};

std::vector<CellOnRay> CellsOnRay(const Eigen::Vector2d& origin, const Eigen::Vector2d& along, double length) {
  std::vector<CellOnRay> steps;
  WalkRay(origin, along, length, [&](int x, int y, double from, double to) { steps.push_back({x, y, from, to}); });
  return steps;
}

TEST(RayWalk, CrossesThreeCellsStraightOn) {
  const auto steps = CellsOnRay({0.5, 0.5}, {1.0, 0.0}, 2.0);
  ASSERT_EQ(steps.size(), 3u);
  EXPECT_EQ(steps[2].x, 2);
  EXPECT_NEAR(steps[0].to, 0.5, 1e-12);
  EXPECT_NEAR(steps[1].to, 1.5, 1e-12);
  EXPECT_NEAR(steps[2].to, 2.0, 1e-12);
}

TEST(RayWalk, EveryPieceLiesInItsCellAndTheyMakeUpTheRay) {
  std::mt19937_64 rng(1);
  std::uniform_real_distribution<double> place(-5.0, 5.0), turn(-kPi, kPi), length(0.0, 40.0);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector2d origin(place(rng), place(rng));
    const double angle = i % 8 == 0 ? (i / 8 % 4) * kPi / 2 : turn(rng);
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    const double way = length(rng);
    double at = 0.0;
    for (const CellOnRay& step : CellsOnRay(origin, along, way)) {
      ASSERT_NEAR(step.from, at, 1e-12);
      ASSERT_LE(step.from, step.to + 1e-9);
      const Eigen::Vector2d middle = origin + 0.5 * (step.from + step.to) * along;
      EXPECT_NEAR(middle.x(), step.x + 0.5, 0.5 + 1e-6);
      EXPECT_NEAR(middle.y(), step.y + 0.5, 0.5 + 1e-6);
      at = step.to;
    }
    EXPECT_EQ(at, way);
  }
}

TEST(RayWalk, StartsOnABorderInEitherDirection) {
  EXPECT_NEAR(CellsOnRay({2.0, 0.5}, {-1.0, 0.0}, 1.5).back().to, 1.5, 1e-12);
  EXPECT_EQ(CellsOnRay({2.0, 0.5}, {-1.0, 0.0}, 1.5).back().x, 0);
  EXPECT_EQ(CellsOnRay({2.0, 0.5}, {1.0, 0.0}, 1.5).back().x, 3);
  EXPECT_EQ(CellsOnRay({2.0, 0.5}, {1.0, 0.0}, 0.0).size(), 1u);
}

}  // namespace
}  // namespace cairn::slam
