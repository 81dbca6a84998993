#include "server/slam/scan/surface_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "common/geometry/angle.h"
#include "server/slam/scan/beam_points.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

constexpr double kWallM = 1.0;  // Distance of a wall beside the robot.

const test::Laser kDenseLaser{.beams = 721, .step_rad = Radians(0.25), .sigma_m = 0.02};

// A wall along the robot's way, to the right of it. It recedes in the sense in which the laser turns.
test::World WallToTheRight() {
  test::World world;
  world.Add({{0.0, -kWallM}, {4.0, -kWallM}});
  return world;
}

std::vector<SurfacePoint> SurfaceOf(const test::World& world, const test::Laser& laser, std::mt19937_64* rng) {
  const Scan scan = test::Look(world, {}, laser, rng);
  return SurfacePointsOf(PointsOf(scan), scan, {});
}

// How far points of this wall lie outside of it.
struct Outside {
  double mean_m = 0.0;
  double deviation_m = 0.0;
};

Outside OutsideTheWall(const test::Laser& laser, int scans) {
  std::mt19937_64 rng(7);
  double sum = 0.0, squares = 0.0, points = 0.0;
  for (int k = 0; k < scans; ++k)
    for (const SurfacePoint& point : SurfaceOf(WallToTheRight(), laser, &rng)) {
      if (point.p.x() < 0.2 || point.p.x() > 1.5) continue;  // The ends of the wall, and distant hits.
      const double outside_m = -kWallM - point.p.y();
      sum += outside_m;
      squares += outside_m * outside_m;
      points += 1.0;
    }
  return {sum / points, std::sqrt(squares / points)};
}

TEST(SurfacePoints, ThinningMovesNoWall) {
  EXPECT_LT(std::abs(OutsideTheWall(kDenseLaser, 300).mean_m), 0.0008);
}

TEST(SurfacePoints, APointStandsForTheHitsAroundIt) {
  EXPECT_LT(OutsideTheWall(kDenseLaser, 300).deviation_m, 0.6 * kDenseLaser.sigma_m);
}

TEST(SurfacePoints, AreSpacedAndLeaveNothingOut) {
  test::Laser exact = kDenseLaser;
  exact.sigma_m = 0.0;
  const SurfaceOptions options;
  const std::vector<SurfacePoint> points = SurfaceOf(test::Room(-2.0, -1.5, 4.0, 3.0), exact, nullptr);
  ASSERT_GT(points.size(), 100U);
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double apart_m = (points[i].p - points[i - 1].p).norm();
    EXPECT_LT(apart_m, 2.5 * options.min_spacing_m) << points[i].p.transpose();
    // In corners two surfaces end, and a few hits are left over.
    if (points[i].smooth() && points[i].normal.dot(points[i - 1].normal) > 0.999) {
      EXPECT_GT(apart_m, 0.5 * options.min_spacing_m) << points[i].p.transpose();
    }
  }
}

}  // namespace
}  // namespace cairn::slam
