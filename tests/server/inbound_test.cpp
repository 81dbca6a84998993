#include "server/inbound.h"

#include <gtest/gtest.h>

#include <thread>

namespace cairn::server {
namespace {

InboundValue ScanValue(std::uint64_t sequence) {
  auto scan = std::make_shared<Scan>();
  scan->sequence = sequence;
  return ScanArrival{.stream = {}, .scan = std::move(scan), .refused = std::nullopt, .received = {}};
}

InboundValue RequestOf(ClientId client) {
  SessionRequest request;
  request.client = client;
  return request;
}

TEST(Inbound, ValuesOfAllLanesLeaveInTheOrderTheyCame) {
  Inbound inbound(8);
  EXPECT_TRUE(inbound.TryPush(ScanValue(1)));
  EXPECT_TRUE(inbound.TryPush(RequestOf(7)));
  EXPECT_TRUE(inbound.TryPush(Request{}));
  EXPECT_TRUE(inbound.TryPush(ScanValue(2)));
  EXPECT_EQ(inbound.size(), 4U);
  EXPECT_TRUE(std::holds_alternative<ScanArrival>(*inbound.Pop()));
  EXPECT_TRUE(std::holds_alternative<SessionRequest>(*inbound.Pop()));
  EXPECT_TRUE(std::holds_alternative<Request>(*inbound.Pop()));
  EXPECT_EQ(std::get<ScanArrival>(*inbound.Pop()).scan->sequence, 2U);
  EXPECT_EQ(inbound.taken(), 4U);
}

// Two robots that streamed fast filled the one channel there was; a third could not open its session and was not told,
// and the end of a client's lease was lost, so that no other client could use its robot's name.
TEST(Inbound, AFloodInOneLaneDisplacesNothingInAnother) {
  Inbound inbound(4);
  for (std::uint64_t i = 1; i <= 4; ++i) EXPECT_TRUE(inbound.TryPush(ScanValue(i)));
  EXPECT_FALSE(inbound.TryPush(ScanValue(5)));
  EXPECT_FALSE(inbound.TryPush(OdometryArrival{}));
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(inbound.TryPush(Request{}));
  EXPECT_FALSE(inbound.TryPush(Request{}));
  EXPECT_TRUE(inbound.TryPush(RequestOf(7)));
  EXPECT_TRUE(inbound.TryPush(ClientLiveliness{7, 1, false}));
  static_cast<void>(inbound.Pop());
  EXPECT_TRUE(inbound.TryPush(ScanValue(5)));
}

TEST(Inbound, ARobotThatFloodsLeavesRoomForTheOthers) {
  constexpr std::size_t kRoom = 4 * Inbound::kLeastShare + 40, kShare = kRoom / 4;
  Inbound inbound(kRoom);
  const auto of_robot = [](NameId robot) { return OdometryArrival{.stream = {robot, 1, 1}, .odometry = {}}; };
  for (std::size_t i = 0; i < kShare; ++i) EXPECT_TRUE(inbound.TryPush(of_robot(1)));
  EXPECT_FALSE(inbound.TryPush(of_robot(1)));
  EXPECT_TRUE(inbound.TryPush(of_robot(2)));
  // What has left makes room again.
  static_cast<void>(inbound.Pop());
  EXPECT_TRUE(inbound.TryPush(of_robot(1)));
  EXPECT_FALSE(inbound.TryPush(of_robot(1)));
}

TEST(Inbound, SessionRequestsAreBoundedAndLivelinessIsNeverRefused) {
  Inbound inbound(4);
  for (std::size_t i = 0; i < Inbound::kMaxControl; ++i) EXPECT_TRUE(inbound.TryPush(RequestOf(1)));
  EXPECT_FALSE(inbound.TryPush(RequestOf(1)));
  for (int i = 0; i < 100; ++i) {
    EXPECT_TRUE(inbound.TryPush(ClientLiveliness{8, 1, i % 2 == 1}));
    EXPECT_TRUE(inbound.TryPush(ClientLiveliness{9, 1, i % 2 == 0}));
  }
  EXPECT_EQ(inbound.size(), Inbound::kMaxControl + 2);
  for (std::size_t i = 0; i < Inbound::kMaxControl; ++i) static_cast<void>(inbound.Pop());
  const auto eight = std::get<ClientLiveliness>(*inbound.Pop()), nine = std::get<ClientLiveliness>(*inbound.Pop());
  EXPECT_EQ(eight.client, 8U);
  EXPECT_TRUE(eight.alive);
  EXPECT_EQ(nine.client, 9U);
  EXPECT_FALSE(nine.alive);
}

// A lease that is lost after the request must be passed on after it, also where an older message of the lease still
// waits.
TEST(Inbound, TheNewestLivelinessStaysBehindTheRequestBeforeIt) {
  Inbound inbound(4);
  EXPECT_TRUE(inbound.TryPush(ClientLiveliness{7, 1, true}));
  EXPECT_TRUE(inbound.TryPush(RequestOf(7)));
  EXPECT_TRUE(inbound.TryPush(ClientLiveliness{7, 1, false}));
  EXPECT_TRUE(std::holds_alternative<SessionRequest>(*inbound.Pop()));
  EXPECT_FALSE(std::get<ClientLiveliness>(*inbound.Pop()).alive);
  EXPECT_EQ(inbound.size(), 0U);
}

TEST(Inbound, PushWaitsForRoomAndPopForAValue) {
  Inbound inbound(1);
  std::jthread sender([&inbound] {
    for (std::uint64_t i = 1; i <= 1000; ++i) EXPECT_TRUE(inbound.Push(ScanValue(i)));
    inbound.Close();
  });
  std::uint64_t expected = 1;
  while (const auto value = inbound.Pop()) EXPECT_EQ(std::get<ScanArrival>(*value).scan->sequence, expected++);
  EXPECT_EQ(expected, 1001U);
}

TEST(Inbound, AfterTheCloseOnlyWhatIsInsideGoesOut) {
  Inbound inbound(1);
  EXPECT_TRUE(inbound.Push(ScanValue(1)));
  std::jthread closer([&inbound] { inbound.Close(); });
  EXPECT_FALSE(inbound.Push(ScanValue(2)));
  EXPECT_FALSE(inbound.TryPush(ClientLiveliness{7, 1, false}));
  EXPECT_TRUE(inbound.Pop());
  EXPECT_FALSE(inbound.Pop());
}

TEST(Inbound, AStopEndsTheWait) {
  Inbound inbound(1);
  std::jthread receiver([&inbound](const std::stop_token& stop) { EXPECT_FALSE(inbound.Pop(stop)); });
}

}  // namespace
}  // namespace cairn::server
