#include "server/slam/scan/beam_points.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

Scan ThreeBeams() {
  Scan scan;
  scan.angle_first_rad = -kPi / 2;
  scan.angle_step_rad = kPi / 2;
  scan.range_min_m = 0.1;
  scan.range_max_m = 10.0;
  scan.ranges_m = {1.0F, 2.0F, 3.0F};
  return scan;
}

TEST(BeamPoints, StandWhereTheBeamsHitInTheRobotFrame) {
  Scan scan = ThreeBeams();
  scan.T_robot_laser = {0.5, 0.0, kPi / 2};
  const std::vector<BeamPoint> points = PointsOf(scan);
  ASSERT_EQ(points.size(), 3U);
  EXPECT_NEAR((points[0].p_robot - Eigen::Vector2d(1.5, 0.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((points[1].p_robot - Eigen::Vector2d(0.5, 2.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((points[2].p_robot - Eigen::Vector2d(-2.5, 0.0)).norm(), 0.0, 1e-9);
  EXPECT_EQ(points[2].beam, 2);
  EXPECT_DOUBLE_EQ(points[0].bearing_rad, -kPi / 2);
}

TEST(BeamPoints, OnlyHitsBecomePoints) {
  Scan scan = ThreeBeams();
  scan.ranges_m = {std::numeric_limits<float>::quiet_NaN(), 10.0F, -1.0F, 0.05F, 5.0F,
                   std::numeric_limits<float>::infinity()};
  const std::vector<BeamPoint> points = PointsOf(scan);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].beam, 4);
}

TEST(BeamPoints, TiltShortensWhatIsAheadNotWhatIsBeside) {
  Scan scan = ThreeBeams();
  scan.tilt_rad = Radians(60.0);
  const std::vector<BeamPoint> points = PointsOf(scan);
  ASSERT_EQ(points.size(), 3U);
  EXPECT_NEAR((points[0].p_robot - Eigen::Vector2d(0.0, -1.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((points[1].p_robot - Eigen::Vector2d(1.0, 0.0)).norm(), 0.0, 1e-9);
}

TEST(BeamPoints, AFullTurnIsToldFromAlmostOne) {
  Scan scan;
  scan.angle_step_rad = Radians(1.0);
  scan.ranges_m.assign(360, 1.0F);
  EXPECT_TRUE(IsFullTurn(scan));
  scan.ranges_m.assign(361, 1.0F);  // First and last beam look the same way.
  EXPECT_TRUE(IsFullTurn(scan));
  scan.ranges_m.assign(358, 1.0F);
  EXPECT_FALSE(IsFullTurn(scan));
  scan.angle_step_rad = -2.0 * kPi / 358;
  EXPECT_TRUE(IsFullTurn(scan));
}

}  // namespace
}  // namespace cairn::slam
