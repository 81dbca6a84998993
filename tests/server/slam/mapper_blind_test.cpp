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
// determines the position along it.
struct CorridorDrive {
  Pose2 truth, odometry;  // At the end.
  ScanOutcome outcome;
  int degenerate = 0;
  double worst_step_m = 0.0;
};

// 20 m in `steps` steps. The odometry is wrong in both: 2 % too long along the corridor (or `scale`), and at the end
// wrong by 0.4 rad and 4 m to the side.
CorridorDrive DriveAlongABareCorridor(int steps, double scale = 1.02) {
  test::World corridor;
  corridor.Add({{-100, 1}, {100, 1}}).Add({{-100, -1}, {100, -1}});
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, {}, 1);
  std::mt19937_64 rng(5);
  const Laser laser{.beams = 361, .step_rad = Radians(0.5), .sigma_m = 0.005};
  CorridorDrive drive;
  for (int i = 0; i < steps; ++i) {
    const double x = 20.0 * i / steps;
    const Pose2 truth{x, 0.1 * std::sin(x), 0.1 * std::cos(x) - 0.1};
    const Pose2 step = Between(drive.truth, truth);
    drive.odometry = drive.odometry * Pose2{scale * step.x, step.y, step.theta + 0.4 / steps};
    auto scan = std::make_shared<Scan>(Look(corridor, truth, laser, &rng));
    scan->stamp = i + 1;
    const Pose2 before = drive.outcome.T_map_robot;
    drive.outcome = mapper.Process(std::move(scan), drive.odometry, SerialFor);
    drive.degenerate += drive.outcome.reason == PoseReason::kDegenerate ? 1 : 0;
    EXPECT_NEAR(drive.outcome.T_map_robot.y, truth.y, 0.05);
    EXPECT_NEAR(AngleDiff(drive.outcome.T_map_robot.theta, truth.theta), 0.0, 0.02);
    const double step_m = (drive.outcome.T_map_robot.translation() - before.translation()).norm();
    if (i > 0) drive.worst_step_m = std::max(drive.worst_step_m, step_m);
    drive.truth = truth;
  }
  return drive;
}

TEST(Mapper, TakesOnlyTheWayAlongABareCorridorFromOdometryAndSaysSo) {
  constexpr int kSteps = 200;
  const CorridorDrive drive = DriveAlongABareCorridor(kSteps);
  EXPECT_GT(std::abs(drive.odometry.y - drive.truth.y), 2.0) << "the walls must be needed";
  EXPECT_GT(drive.degenerate, kSteps * 9 / 10);
  EXPECT_LT(drive.worst_step_m, 0.3);
  EXPECT_NEAR(drive.outcome.T_map_robot.x, 1.02 * drive.truth.x, 0.15)
      << "neither shorter nor longer than odometry says";
}

// It once claimed 0.045 m after 20 m, because a scan that matched added no uncertainty of the odometry from which it
// took its way; and the doubt of odometry counted per scan, not per metre.
TEST(Mapper, TheDoubtAlongABareCorridorIsThatOfTheOdometryHoweverManyScansShowIt) {
  for (const int steps : {150, 300}) {
    const CorridorDrive drive = DriveAlongABareCorridor(steps);
    const double along_m = std::sqrt(drive.outcome.covariance(0, 0)),
                 across_m = std::sqrt(drive.outcome.covariance(1, 1));
    EXPECT_NEAR(along_m, OdometryNoise{}.trans_m_per_sqrt_m * std::sqrt(20.0), 0.05) << steps;
    EXPECT_LT(std::abs(drive.outcome.T_map_robot.x - drive.truth.x), 2.5 * along_m) << steps;
    EXPECT_LT(across_m, 0.5 * along_m) << steps;
  }
}

// The doubt is that of a random walk. An error of the scale, which makes the same error with every metre, is not in it.
TEST(Mapper, AScaleErrorOfOdometryAlongABareCorridorIsMoreThanTheDoubtSays) {
  const CorridorDrive drive = DriveAlongABareCorridor(150, 1.05);
  EXPECT_GT(std::abs(drive.outcome.T_map_robot.x - drive.truth.x), 3.0 * std::sqrt(drive.outcome.covariance(0, 0)));
}

}  // namespace
}  // namespace cairn::slam
