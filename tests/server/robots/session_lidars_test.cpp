// A robot with several lidars.
#include <gtest/gtest.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "tests/server/robots/one_session.h"

namespace cairn::server {
namespace {

using testing::OdometryOf;
using testing::OneSession;
using testing::RoomOdometry;
using testing::RoomScan;
using testing::ScanOf;

// The second driver delivers its scans later than the first one, although they are older.
TEST(Session, UsesTheScansOfTwoLidarsWhoseDriversDoNotWaitForEachOther) {
  OneSession one;
  ASSERT_TRUE(one.session().record().AddSensors({"back"}));
  constexpr std::uint64_t kOfEach = 12;
  for (int step = 0; step <= static_cast<int>(kOfEach); ++step) {
    one.session().Take(OdometryOf("r1", RoomOdometry(step)));
    EXPECT_TRUE(one.session().Take(ScanOf("r1", RoomScan(step))));
    if (step == 0) continue;
    Scan late = RoomScan(step);
    late.stamp -= 20'000'000;
    late.sequence = static_cast<std::uint64_t>(step);
    ScanArrival arrival = ScanOf("r1", std::move(late));
    arrival.stream.sensor_id = HashName("back");
    EXPECT_TRUE(one.session().Take(std::move(arrival)));
  }
  one.session().End();
  ASSERT_TRUE(one.WaitPhase(SessionPhase::kEnded));
  std::uint64_t used = 0;
  for (const Ledger& ledger : one.session().record().snapshot().status.ledgers) {
    if (ledger.sensor != "odometry") used += ledger.used;
  }
  // Only the very first one of the second lidar comes too late: nobody knew of that lidar.
  EXPECT_EQ(used, 2 * kOfEach);
}

// The two topics of a robot do not keep one order. Its first scans were used without the odometry that came right after
// them, and its path was another one each time.
TEST(Session, WaitsForTheOdometryOfTheFirstScansHoweverFarTheseAreAhead) {
  constexpr int kSteps = 40;  // Four seconds.
  const auto path = [](int ahead) {
    OneSession one({}, "r1", {.no_odometry_after_s = 1e6});
    for (int step = 0; step < kSteps + ahead; ++step) {
      if (step < kSteps) {
        EXPECT_TRUE(one.session().Take(ScanOf("r1", RoomScan(step))));
      }
      if (step >= ahead) one.session().Take(OdometryOf("r1", RoomOdometry(step - ahead)));
    }
    EXPECT_TRUE(one.WaitSettled(kSteps));
    std::vector<Pose2> poses;
    for (const PoseReport& pose : one.sent().All<PoseReport>()) poses.push_back(pose.T_map_robot);
    return poses;
  };
  const std::vector<Pose2> together = path(0);
  EXPECT_EQ(together.size(), std::size_t{kSteps});
  EXPECT_EQ(path(kSteps), together);
}

// All that wait go on at once. One more than the queue holds waited, and the first was dropped.
TEST(Session, OfARobotWithoutOdometryNoMoreScansWaitThanItsQueueHolds) {
  constexpr int kQueue = 4;
  OneSession one({.queue_scans = kQueue}, "r1", {.no_odometry_after_s = 1e6, .no_odometry_after_scans = kQueue});
  for (int step = 0; step < kQueue; ++step) EXPECT_TRUE(one.session().Take(ScanOf("r1", RoomScan(step))));
  EXPECT_TRUE(one.WaitSettled(kQueue));
  for (const Ledger& ledger : one.session().record().snapshot().status.ledgers)
    EXPECT_EQ(Dropped(ledger, DropReason::kQueueFull), 0U) << ledger.sensor;
}

}  // namespace
}  // namespace cairn::server
