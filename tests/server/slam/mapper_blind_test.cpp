// A mapper whose scans add nothing: the robot stands, sees nothing, or its scanner looks at the floor.
#include <gtest/gtest.h>

#include <memory>

#include "server/slam/mapper.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

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

}  // namespace
}  // namespace cairn::slam
