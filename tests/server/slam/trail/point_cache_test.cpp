#include "server/slam/trail/point_cache.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/slam/scan/beam_points.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {
namespace {

TEST(PointCache, KeepsThoseLookedAtLastWithinItsBound) {
  PointCache cache(10);
  for (std::size_t k = 0; k < 3; ++k) cache.Keep(k, std::vector<SurfacePoint>(4));
  EXPECT_EQ(cache.points(), 8U);
  EXPECT_EQ(cache.Find(0), nullptr);
  ASSERT_NE(cache.Find(1), nullptr);  // Now it is the one looked at last.
  cache.Keep(3, std::vector<SurfacePoint>(5));
  EXPECT_NE(cache.Find(1), nullptr);
  EXPECT_EQ(cache.Find(2), nullptr);
  EXPECT_EQ(cache.points(), 9U);
  cache.Keep(4, std::vector<SurfacePoint>(100));  // More than all: it alone.
  EXPECT_EQ(cache.points(), 100U);
  EXPECT_EQ(cache.Find(4)->size(), 100U);
  cache.Clear();
  EXPECT_EQ(cache.points(), 0U);
  EXPECT_EQ(cache.Find(4), nullptr);
}

TEST(PointCache, PointsStayValidForThoseWhoHoldThem) {
  PointCache cache(3);
  const SharedPoints held = cache.Keep(1, {SurfacePoint{{1.0, 2.0}, {0.0, 1.0}}});
  for (std::size_t k = 2; k < 20; ++k) cache.Keep(k, std::vector<SurfacePoint>(2));
  EXPECT_EQ(cache.Find(1), nullptr);
  EXPECT_EQ(held->front().p, Eigen::Vector2d(1.0, 2.0));
}

// A round room, seen from somewhere in it.
Scan RoomScan(std::size_t number) {
  Scan scan;
  scan.angle_first_rad = -3.0;
  scan.angle_step_rad = 0.01;
  scan.range_max_m = 30.0;
  for (std::size_t beam = 0; beam < 600; ++beam)
    scan.ranges_m.push_back(static_cast<float>(5.0 + std::sin(0.02 * static_cast<double>(beam * (number % 7 + 1)))));
  return scan;
}

// Far more keyframes than points are kept of: those of the first ones are computed again, to the last bit.
TEST(Trail, PointsThatWereLetGoAreComputedAgain) {
  Trail trail(MotionNoise{});
  constexpr std::size_t kKeyframes = 1500;
  const auto points_of = [](const Scan& scan) { return SurfacePointsOf(PointsOf(scan), scan, {}); };
  for (std::size_t k = 0; k < kKeyframes; ++k) {
    const Scan scan = RoomScan(k);
    trail.Append({std::make_shared<const Scan>(scan), {}}, {0.2 * static_cast<double>(k), 0.0, 0.0}, points_of(scan),
                 Eigen::Matrix3d::Zero(), std::nullopt);
  }
  EXPECT_GT(kKeyframes * points_of(RoomScan(0)).size(), std::size_t{1} << 18);  // More than it keeps.
  for (std::size_t k = 0; k < kKeyframes; k += 97) {
    const std::vector<SurfacePoint> expected = points_of(RoomScan(k));
    const SharedPoints points = trail.points(k);
    ASSERT_EQ(points->size(), expected.size()) << k;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      ASSERT_EQ((*points)[i].p, expected[i].p) << k << ", " << i;
      ASSERT_EQ((*points)[i].normal, expected[i].normal) << k << ", " << i;
    }
  }
}

}  // namespace
}  // namespace cairn::slam
