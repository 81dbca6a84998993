#include "server/robots/robot_queue.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

ScanArrival ScanOf(std::uint64_t sequence) {
  auto scan = std::make_shared<Scan>();
  scan->sequence = sequence;
  return {.stream = {}, .scan = scan, .refused = std::nullopt, .received = {}};
}

OdometryArrival OdometryOf(std::uint64_t sequence) {
  OdometryArrival arrival;
  arrival.odometry.sequence = sequence;
  return arrival;
}

TEST(RobotQueue, EventsOfAllKindsLeaveInOrderOfArrival) {
  RobotQueue queue(8, 8);
  EXPECT_FALSE(queue.Push(OdometryOf(1)));
  EXPECT_FALSE(queue.Push(ScanOf(1)));
  queue.Push(Finish{.final = true, .done = {}});
  EXPECT_FALSE(queue.Push(ScanOf(2)));
  EXPECT_TRUE(std::holds_alternative<OdometryArrival>(*queue.Pop()));
  EXPECT_TRUE(std::holds_alternative<ScanArrival>(*queue.Pop()));
  EXPECT_TRUE(std::holds_alternative<Finish>(*queue.Pop()));
  EXPECT_EQ(std::get<ScanArrival>(*queue.Pop()).scan->sequence, 2U);
  EXPECT_FALSE(queue.Pop());
  EXPECT_TRUE(queue.empty());
}

TEST(RobotQueue, AFullQueueGivesUpTheOldestScan) {
  RobotQueue queue(2, 8);
  EXPECT_FALSE(queue.Push(ScanOf(1)));
  EXPECT_FALSE(queue.Push(ScanOf(2)));
  const auto displaced = queue.Push(ScanOf(3));
  ASSERT_TRUE(displaced);
  EXPECT_EQ(displaced->scan->sequence, 1U);
  EXPECT_EQ(std::get<ScanArrival>(*queue.Pop()).scan->sequence, 2U);
}

TEST(RobotQueue, FullOdometryKeepsTheNewerOfTheTwoOldest) {
  RobotQueue queue(2, 2);
  EXPECT_FALSE(queue.Push(OdometryOf(1)));
  EXPECT_FALSE(queue.Push(OdometryOf(2)));
  const auto merged = queue.Push(OdometryOf(3));
  ASSERT_TRUE(merged);
  EXPECT_EQ(merged->odometry.sequence, 1U);
  EXPECT_EQ(std::get<OdometryArrival>(*queue.Pop()).odometry.sequence, 2U);
}

TEST(RobotQueue, OfSuccessiveChangesOfTheEpochTheNewestStays) {
  RobotQueue queue(2, 2);
  queue.Push(EpochChange{1});
  queue.Push(EpochChange{2});
  queue.Push(Finish{});
  EXPECT_EQ(std::get<EpochChange>(*queue.Pop()).epoch, 2U);
  EXPECT_TRUE(std::holds_alternative<Finish>(*queue.Pop()));
}

TEST(RobotQueue, TheNewestCorrectionWins) {
  RobotQueue queue(2, 2);
  EXPECT_FALSE(queue.Push(Correction{.epoch = 1, .grid = {}, .done = {}}));
  const auto superseded = queue.Push(Correction{.epoch = 2, .grid = {}, .done = {}});
  ASSERT_TRUE(superseded);
  EXPECT_EQ(superseded->epoch, 1U);
  EXPECT_EQ(std::get<Correction>(*queue.Pop()).epoch, 2U);
  EXPECT_TRUE(queue.empty());
}

// A burst of snapshots was able to push the end of a session aside once; its robot was told it had ended all the same.
TEST(RobotQueue, TooManySnapshotsAreRefusedAndTheEndNever) {
  RobotQueue queue(2, 2);
  for (std::size_t i = 0; i < RobotQueue::kMaxControl; ++i) EXPECT_TRUE(queue.Push(SnapshotWanted{}));
  EXPECT_FALSE(queue.Push(SnapshotWanted{}));
  EXPECT_FALSE(queue.Push(RelocaliseWanted{}));
  queue.Push(Finish{.final = true, .done = {}});
  for (std::size_t i = 0; i < RobotQueue::kMaxControl; ++i)
    EXPECT_TRUE(std::holds_alternative<SnapshotWanted>(*queue.Pop()));
  EXPECT_TRUE(std::holds_alternative<Finish>(*queue.Pop()));
}

TEST(RobotQueue, TakeScansLeavesTheRest) {
  RobotQueue queue(4, 4);
  queue.Push(ScanOf(1));
  queue.Push(OdometryOf(1));
  queue.Push(ScanOf(2));
  EXPECT_EQ(queue.TakeScans().size(), 2U);
  EXPECT_TRUE(std::holds_alternative<OdometryArrival>(*queue.Pop()));
  EXPECT_TRUE(queue.empty());
}

}  // namespace
}  // namespace cairn::server
