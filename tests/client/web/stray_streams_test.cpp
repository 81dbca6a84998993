#include "client/web/stray_streams.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/loopback.h"

namespace cairn::web {
namespace {

using namespace std::chrono_literals;
using namespace test;
using ::testing::HasSubstr;

// As the server says it: without names.
Ledger Unclaimed(NameId robot, std::uint64_t dropped, DropReason reason = DropReason::kNoSession) {
  Ledger ledger;
  ledger.robot_id = robot;
  ledger.sensor_id = 9;
  ledger.dropped[static_cast<std::size_t>(reason)] = dropped;
  return ledger;
}

SessionRefusal Refused(const std::string& robot, const std::string& why) {
  SessionRefusal refusal;
  refusal.state.robot = robot;
  refusal.state.robot_id = HashName(robot);
  refusal.state.phase = SessionPhase::kRefused;
  refusal.state.status = {StatusCode::kResourceExhausted, why};
  return refusal;
}

const StrayStreams::Clock::time_point kStart{1h};

TEST(StrayStreams, AreShownWhileTheirScansAreDropped) {
  StrayStreams strays;
  strays.Take(Unclaimed(5, 3), kStart);
  EXPECT_TRUE(strays.Shown(kStart).empty()) << "what the server said last of it may be minutes old";
  strays.Take(Unclaimed(5, 4), kStart + 1s);
  const auto shown = strays.Shown(kStart + 2s);
  ASSERT_EQ(shown.size(), 1U);
  EXPECT_EQ(shown[0].robot, "number 0000000000000005");
  EXPECT_EQ(shown[0].dropped, 4U);
  EXPECT_THAT(shown[0].why, HasSubstr("no session"));
  strays.Take(Unclaimed(5, 4), kStart + 12s);
  EXPECT_TRUE(strays.Shown(kStart + 12s).empty()) << "it sends no more";
}

TEST(StrayStreams, ARefusalNamesTheRobotAndSaysWhy) {
  StrayStreams strays;
  const NameId r7 = HashName("r7");
  strays.Take(Refused("r7", "the server is full"), kStart);
  EXPECT_TRUE(strays.Shown(kStart).empty()) << "it may have given up, and sends nothing";
  strays.Take(Unclaimed(r7, 1), kStart);
  strays.Take(Unclaimed(r7, 2), kStart);
  ASSERT_EQ(strays.Shown(kStart).size(), 1U);
  EXPECT_EQ(strays.Shown(kStart)[0].robot, "r7");
  EXPECT_THAT(strays.Shown(kStart)[0].why, HasSubstr("the server is full"));
  Ledger claimed = Unclaimed(r7, 2);
  claimed.robot = "r7";
  strays.Take(claimed, kStart);
  EXPECT_TRUE(strays.Shown(kStart).empty()) << "it has a session now";
}

TEST(StrayStreams, ARobotOfAnotherProgramIsSaidToBeThat) {
  StrayStreams strays;
  for (const std::uint64_t dropped : {1, 2}) strays.Take(Unclaimed(5, dropped, DropReason::kNotOwner), kStart);
  ASSERT_EQ(strays.Shown(kStart).size(), 1U);
  EXPECT_THAT(strays.Shown(kStart)[0].why, HasSubstr("used twice"));
}

TEST(StrayStreams, InventedRobotsCostABoundedAmount) {
  StrayStreams strays;
  for (NameId robot = 0; robot < 1000; ++robot) {
    strays.Take(Unclaimed(robot, 1), kStart);
    strays.Take(Unclaimed(robot, 2), kStart);
  }
  EXPECT_EQ(strays.Shown(kStart).size(), StrayStreams::kMaxStrays);
  strays.Take(Unclaimed(5000, 1), kStart + 11min);
  strays.Take(Unclaimed(5000, 2), kStart + 11min);
  EXPECT_EQ(strays.Shown(kStart + 11min).size(), 1U) << "those that are silent make room";
}

TEST(StrayStreams, HearTheServer) {
  const auto bus = MakeBus("page"), server = MakeBus("server");
  const auto strays = Must(StrayStreams::Create(*bus));
  const auto ledgers = Must(server->Advertise<Ledger>());
  std::uint64_t dropped = 0;
  EXPECT_TRUE(Eventually([&] {
    Must(ledgers->Publish(Unclaimed(5, ++dropped)));
    return !strays->Shown(StrayStreams::Clock::now()).empty();
  }));
}

}  // namespace
}  // namespace cairn::web
