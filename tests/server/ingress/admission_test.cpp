#include "server/ingress/admission.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/server/support/room_world.h"

namespace cairn::server {
namespace {

using testing::RoomOdometry;
using testing::RoomScan;

std::optional<DropReason> RefusalOf(const Scan& scan) {
  return Admit(ScanSample{{1, 2, 3}, scan}, {}).refused;
}

TEST(Admission, AGoodScanPassesWhole) {
  const Scan scan = RoomScan(3);
  const ScanArrival arrival = Admit(ScanSample{{1, 2, 3}, scan}, std::chrono::steady_clock::time_point{});
  EXPECT_FALSE(arrival.refused);
  EXPECT_EQ(arrival.scan->ranges_m, scan.ranges_m);
  EXPECT_EQ(arrival.stream.session, 3U);
}

TEST(Admission, ARefusedScanKeepsNumberAndStampOnly) {
  Scan scan = RoomScan(3);
  scan.angle_step_rad = 1e300;
  const ScanArrival arrival = Admit(ScanSample{{1, 2, 3}, scan}, {});
  EXPECT_EQ(arrival.refused, DropReason::kBadGeometry);
  EXPECT_EQ(arrival.scan->sequence, scan.sequence);
  EXPECT_EQ(arrival.scan->stamp, scan.stamp);
  EXPECT_TRUE(arrival.scan->ranges_m.empty());
}

TEST(Admission, TellsEmptyFromTooManyFromBadGeometry) {
  Scan scan = RoomScan(3);
  scan.ranges_m.clear();
  EXPECT_EQ(RefusalOf(scan), DropReason::kEmpty);
  scan.ranges_m.assign(50, -1.0F);
  EXPECT_EQ(RefusalOf(scan), DropReason::kEmpty);
  scan.ranges_m.assign(kMaxBeams + 1, 1.0F);
  EXPECT_EQ(RefusalOf(scan), DropReason::kTooManyBeams);
  scan = RoomScan(3);
  scan.range_max_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(RefusalOf(scan), DropReason::kBadGeometry);
  scan = RoomScan(3);
  scan.range_min_m = 30.0;
  EXPECT_EQ(RefusalOf(scan), DropReason::kBadGeometry);
  scan = RoomScan(3);
  scan.beam_period_s = -1.0;
  EXPECT_EQ(RefusalOf(scan), DropReason::kBadGeometry);
  // Limits that make every range unusable are bad geometry, not an empty scan.
  scan = RoomScan(3);
  scan.ranges_m.assign(50, 1.0F);
  scan.range_min_m = 5.0;
  scan.range_max_m = 4.0;
  EXPECT_EQ(RefusalOf(scan), DropReason::kBadGeometry);
}

// A session that had believed such a number could not be restored.
TEST(Admission, NumbersThatNoClientCountsToAreRefused) {
  for (const std::uint64_t number : {std::uint64_t{0}, kMaxSequence + 1}) {
    Scan scan = RoomScan(3);
    scan.sequence = number;
    EXPECT_EQ(RefusalOf(scan), DropReason::kBadGeometry);
    Odometry odometry = RoomOdometry(3);
    odometry.sequence = number;
    EXPECT_TRUE(Admit(OdometrySample{{1, 2, 3}, odometry}).refused);
  }
  Scan scan = RoomScan(3);
  scan.sequence = kMaxSequence;
  EXPECT_FALSE(RefusalOf(scan));
}

TEST(Admission, OdometryThatIsNoPoseIsRefused) {
  Odometry odometry = RoomOdometry(3);
  EXPECT_FALSE(Admit(OdometrySample{{1, 2, 3}, odometry}).refused);
  odometry.T_odom_robot.theta = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(Admit(OdometrySample{{1, 2, 3}, odometry}).refused);
  odometry = RoomOdometry(3);
  odometry.T_odom_robot.x = 1e12;
  EXPECT_TRUE(Admit(OdometrySample{{1, 2, 3}, odometry}).refused);
}

}  // namespace
}  // namespace cairn::server
