// A mapper whose scans add little or nothing: the robot stands, drives along a bare corridor, sees nothing, or its
// scanner looks at the floor.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "server/slam/mapper.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::Look;

TEST(Mapper, StandingStillAddsNoKeyframes) {
  MapperOptions options;
  Mapper mapper(options, {}, 1);
  int keyframes = 0;
  for (int i = 0; i < 20; ++i)
    keyframes += mapper.Process(std::make_shared<Scan>(Look(test::Office(), {}, {})), {}, SerialFor).keyframe ? 1 : 0;
  EXPECT_EQ(keyframes, 1);
}

TEST(Mapper, BlindTravelIsReportedAsLost) {
  MapperOptions options;
  Mapper mapper(options, {}, 1);
  (void)mapper.Process(std::make_shared<Scan>(Look(test::Office(), {}, {})), {}, SerialFor);
  Scan empty = Look(test::Office(), {}, {});
  for (float& range : empty.ranges_m) range = 100.0F;  // Nothing hit.
  ScanOutcome outcome;
  for (int i = 1; i <= 30; ++i) outcome = mapper.Process(std::make_shared<Scan>(empty), {0.1 * i, 0, 0}, SerialFor);
  EXPECT_FALSE(outcome.localized);
  EXPECT_EQ(outcome.reason, PoseReason::kLost);
  EXPECT_NEAR(outcome.T_map_robot.x, 3.0, 0.2);  // Odometry carries on.
}

// Between level scans the doubt grows with the way, and the tilted scan is part of the path.
TEST(Mapper, ATiltedScanHasThePoseOfTheOdometryAndItsDoubt) {
  Mapper mapper({}, {}, 1);
  const auto scan = [](double x, Stamp stamp, double tilt_rad) {
    auto looked = std::make_shared<Scan>(Look(test::Office(), {x, 0, 0}, {}));
    looked->stamp = stamp;
    looked->tilt_rad = tilt_rad;
    return looked;
  };
  const ScanOutcome level = mapper.Process(scan(0.0, 100, 0.0), {3, 2, 1}, SerialFor);
  const Pose2 T_odom_robot = Pose2{3, 2, 1} * Pose2{0.5, 0, 0};
  const ScanOutcome tilted = mapper.Process(scan(0.5, 200, 0.5), T_odom_robot, SerialFor);
  EXPECT_NEAR(tilted.T_map_robot.x, 0.5, 1e-9);
  EXPECT_EQ(tilted.reason, PoseReason::kOdometryOnly);
  EXPECT_GT(tilted.covariance(0, 0), level.covariance(0, 0) + 1e-6);
  EXPECT_TRUE(IsCovariance(tilted.covariance));
  const MapperSnapshot snapshot = mapper.Snapshot();
  ASSERT_EQ(snapshot.scans.size(), 2U);
  // After MapperOptions::lost_after_m without a level scan the robot is lost.
  const ScanOutcome far = mapper.Process(scan(0.5, 300, 0.5), Pose2{3, 2, 1} * Pose2{2.5, 0, 0}, SerialFor);
  EXPECT_EQ(far.reason, PoseReason::kLost);
  EXPECT_FALSE(far.localized);
}

// Thesis A 3.5.13: a bare corridor determines the heading and the distances to its walls; only odometry
// determines the position along it. The odometry is wrong in both: 5 % too long along the corridor, and at
// the end wrong by 0.4 rad and 4 m to the side.
TEST(Mapper, TakesOnlyTheWayAlongABareCorridorFromOdometryAndSaysSo) {
  test::World corridor;
  corridor.Add({{-100, 1}, {100, 1}}).Add({{-100, -1}, {100, -1}});
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, {}, 1);
  constexpr int kSteps = 200;
  std::mt19937_64 rng(5);
  const Laser laser{.beams = 361, .step_rad = Radians(0.5), .sigma_m = 0.005};
  int degenerate = 0;
  double worst_step_m = 0.0;
  Pose2 truth_before, odometry;
  ScanOutcome outcome;
  for (int i = 0; i < kSteps; ++i) {
    const Pose2 truth{0.1 * i, 0.1 * std::sin(0.1 * i), 0.1 * std::cos(0.1 * i) - 0.1};
    const Pose2 step = Between(truth_before, truth);
    odometry = odometry * Pose2{1.05 * step.x, step.y, step.theta + 0.002};
    auto scan = std::make_shared<Scan>(Look(corridor, truth, laser, &rng));
    scan->stamp = i + 1;
    const Pose2 before = outcome.T_map_robot;
    outcome = mapper.Process(std::move(scan), odometry, SerialFor);
    degenerate += outcome.reason == PoseReason::kDegenerate ? 1 : 0;
    EXPECT_NEAR(outcome.T_map_robot.y, truth.y, 0.05);
    EXPECT_NEAR(AngleDiff(outcome.T_map_robot.theta, truth.theta), 0.0, 0.02);
    if (i > 0) worst_step_m = std::max(worst_step_m, (outcome.T_map_robot.translation() - before.translation()).norm());
    truth_before = truth;
  }
  EXPECT_GT(std::abs(odometry.y - truth_before.y), 2.0) << "the walls must be needed";
  EXPECT_GT(degenerate, kSteps * 9 / 10);
  EXPECT_LT(worst_step_m, 0.3);
  EXPECT_NEAR(outcome.T_map_robot.x, 1.05 * truth_before.x, 0.2) << "neither shorter nor longer than odometry says";
  // The pose should say that it does not know the way along: 1 m is the error. It claims 0.04 m, because a
  // scan that matched adds no uncertainty of the odometry it took its way from. The true value is pinned from
  // both sides.
  EXPECT_NEAR(std::sqrt(outcome.covariance(0, 0)), 0.045, 0.02);
}

}  // namespace
}  // namespace cairn::slam
