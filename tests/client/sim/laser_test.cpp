#include "client/sim/laser.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/flat_world.h"

namespace cairn::sim {
namespace {

const RayCaster& Room() {  // x -4..6, y -3..5.
  static const RayCaster walls({{{-4, -3}, {6, -3}}, {{6, -3}, {6, 5}}, {{6, 5}, {-4, 5}}, {{-4, 5}, {-4, -3}}});
  return walls;
}

LaserOptions Perfect() {
  LaserOptions options;
  options.error.sigma_m = options.error.sigma_share = options.dropout_share = 0.0;
  options.T_robot_laser = {};
  return options;
}

Scan Measure(const Pose2& T_map_robot, const LaserOptions& options, Random& random, const Twist& twist = {},
             std::span<const Disc> discs = {}) {
  return MeasureFlatScan(Room(), discs, T_map_robot, twist, 1000, options, random);
}

TEST(SimLaser, PerfectRangesEndOnTheWalls) {
  Random random(1);
  for (const double degrees : {90.0, 180.0, 270.0, 360.0}) {
    for (const int beams : {180, 361, 1081}) {
      LaserOptions options = Perfect();
      options.beams = beams;
      options.field_of_view_rad = Radians(degrees);
      options.T_robot_laser = {0.3, -0.1, 0.2};
      const Pose2 T_map_robot{1.0, 0.5, 2.0};
      const Scan scan = Measure(T_map_robot, options, random);
      ASSERT_EQ(scan.ranges_m.size(), static_cast<std::size_t>(beams));
      for (int i = 0; i < beams; ++i) {
        const double angle = scan.angle_first_rad + i * scan.angle_step_rad, range = scan.ranges_m[i];
        const Eigen::Vector2d p =
            T_map_robot * scan.T_robot_laser * Eigen::Vector2d(range * std::cos(angle), range * std::sin(angle));
        const double off =
            std::min({std::abs(p.x() + 4), std::abs(p.x() - 6), std::abs(p.y() + 3), std::abs(p.y() - 5)});
        EXPECT_LT(off, 1e-5) << "beam " << i;
      }
    }
  }
}

TEST(SimLaser, AFullTurnHasNoBeamTwice) {
  Random random(1);
  LaserOptions options = Perfect();
  options.field_of_view_rad = 2 * kPi;
  EXPECT_NEAR(Measure({}, options, random).angle_step_rad, Radians(1.0), 1e-12);
  options.field_of_view_rad = Radians(180);
  options.beams = 181;
  const Scan half = Measure({}, options, random);
  EXPECT_NEAR(half.angle_step_rad, Radians(1.0), 1e-12);
  EXPECT_NEAR(half.angle_first_rad, -kPi / 2, 1e-12);
}

TEST(SimLaser, NoiseGrowsWithRangeAsStated) {
  Random random(3);
  LaserOptions options = Perfect();
  options.beams = 2;
  options.field_of_view_rad = kPi;  // Beams to -y (3 m) and +y (5 m) from the origin.
  options.error.sigma_m = 0.02;
  options.error.sigma_share = 0.004;
  double sum[2] = {}, squares[2] = {};
  const int n = 20000;
  for (int k = 0; k < n; ++k) {
    const Scan scan = Measure({}, options, random);
    for (int i = 0; i < 2; ++i) {
      const double error = scan.ranges_m[i] - (i == 0 ? 3.0 : 5.0);
      sum[i] += error;
      squares[i] += error * error;
    }
  }
  for (int i = 0; i < 2; ++i) {
    const double sigma = i == 0 ? 0.02 + 0.004 * 3 : 0.02 + 0.004 * 5;
    EXPECT_NEAR(sum[i] / n, 0.0, 4 * sigma / std::sqrt(n));
    EXPECT_NEAR(std::sqrt(squares[i] / n), sigma, 0.03 * sigma);
  }
}

TEST(SimLaser, DropoutsHaveTheirShareAndReadZero) {
  Random random(4);
  LaserOptions options = Perfect();
  options.dropout_share = 0.1;
  options.beams = 1000;
  int zeros = 0;
  for (int k = 0; k < 50; ++k) {
    for (const float range : Measure({}, options, random).ranges_m) zeros += range == 0.0f;
  }
  EXPECT_NEAR(zeros / 50000.0, 0.1, 4 * std::sqrt(0.09 / 50000));
}

TEST(SimLaser, WhatIsTooFarReadsInfinity) {
  Random random(5);
  LaserOptions options = Perfect();
  options.range_max_m = 4.5;
  const Scan scan = Measure({}, options, random);
  int nothing = 0;
  for (const float range : scan.ranges_m) {
    nothing += std::isinf(range);
    EXPECT_TRUE(std::isinf(range) || range < 4.5f);
  }
  EXPECT_GT(nothing, 50);
  EXPECT_EQ(scan.range_max_m, 4.5);
  EXPECT_EQ(ClassifyRange(INFINITY, scan.range_min_m, scan.range_max_m), BeamClass::kNoReturn);
}

TEST(SimLaser, DiscsStandBeforeWalls) {
  Random random(6);
  LaserOptions options = Perfect();
  options.beams = 1;
  const Disc disc{{2, 0}, 0.25};
  EXPECT_NEAR(Measure({}, options, random, {}, {&disc, 1}).ranges_m[0], 1.75, 1e-6);
}

TEST(SimLaser, ASweepIsTakenWhileTheRobotTurns) {
  Random random(7);
  LaserOptions options = Perfect();
  options.beams = 181;
  options.field_of_view_rad = kPi;
  options.sweep_s = 0.05;
  const Twist twist{0.8, 1.0};
  const Scan scan = Measure({}, options, random, twist);
  EXPECT_NEAR(scan.beam_period_s, 0.05 / 180, 1e-15);
  // The last beam leaves from where the robot is then, 0.05 rad further round.
  const double angle = kPi / 2 + 0.05, x = 0.8 * std::sin(0.05), y = 0.8 * (1 - std::cos(0.05));
  const double expected = (5.0 - y) / std::sin(angle);
  EXPECT_NEAR(scan.ranges_m.back(), expected, 1e-5);
  EXPECT_GT(x, 0.0);
  EXPECT_NE(scan.ranges_m.back(), Measure({}, Perfect(), random).ranges_m.back());
}

TEST(SimLaser, ScansAreValidScans) {
  Random random(8);
  const Scan scan = Measure({0.5, 0.5, 1}, LaserOptions{}, random);
  const auto valid = ValidateScan(scan);
  EXPECT_TRUE(valid) << valid.error().message;
}

TEST(SimLaser, RefusesImpossibleOptions) {
  EXPECT_TRUE(Validate(LaserOptions{}));
  const auto refuses = [](auto&& change) {
    LaserOptions options;
    change(options);
    return !Validate(options);
  };
  EXPECT_TRUE(refuses([](auto& o) { o.beams = 0; }));
  EXPECT_TRUE(refuses([](auto& o) { o.beams = 8193; }));
  EXPECT_TRUE(refuses([](auto& o) { o.field_of_view_rad = 7.0; }));
  EXPECT_TRUE(refuses([](auto& o) { o.range_max_m = o.range_min_m; }));
  EXPECT_TRUE(refuses([](auto& o) { o.error.sigma_m = std::nan(""); }));
  EXPECT_TRUE(refuses([](auto& o) { o.dropout_share = 1.1; }));
  EXPECT_TRUE(refuses([](auto& o) { o.sweep_s = -1; }));
  EXPECT_TRUE(refuses([](auto& o) { o.T_robot_laser.x = std::nan(""); }));
}

}  // namespace
}  // namespace cairn::sim
