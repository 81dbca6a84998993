#include "server/egress/egress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/loopback.h"

namespace cairn::server {
namespace {

using namespace test;

constexpr Generation kGeneration = 41;

class EgressTest : public ::testing::Test {
 protected:
  void TearDown() override { outbound_.Close(); }

  const std::unique_ptr<wire::Bus> bus_ = MakeBus("server");
  const std::unique_ptr<wire::Bus> client_ = MakeBus("client");
  Outbound outbound_{1024};
  std::unique_ptr<Egress> egress_ = Must(Egress::Open(*bus_, outbound_, kGeneration));
};

template <typename Value>
void ExpectStamped(wire::Bus& client, Outbound& outbound, const Value& value,
                   const std::function<bool(const Value&)>& stamped) {
  Inbox<Value> inbox;
  const auto subscription = Must(client.Subscribe<Value>(inbox.Sink()));
  ASSERT_TRUE(Eventually([&] {
    outbound.Send(value);
    return !inbox.values().empty();
  }));
  EXPECT_TRUE(stamped(inbox.values()[0]));
}

TEST_F(EgressTest, StampsEverythingWithTheGeneration) {
  const auto has = [](const auto& value) { return value.generation == kGeneration; };
  ExpectStamped<SessionState>(*client_, outbound_, {}, has);
  ExpectStamped<Ledger>(*client_, outbound_, {}, has);
  ExpectStamped<PoseReport>(*client_, outbound_, {}, has);
  ExpectStamped<Job>(*client_, outbound_, {}, has);
  ExpectStamped<MapInfo>(*client_, outbound_, {}, has);
  ExpectStamped<TileSample>(*client_, outbound_, {}, has);
  ExpectStamped<SessionRefusal>(*client_, outbound_, {}, [&](const auto& refusal) { return has(refusal.state); });
  Reply reply;
  reply.poses.resize(1);
  reply.maps.resize(1);
  reply.jobs.resize(1);
  reply.robots.resize(1);
  reply.robots[0].ledgers.resize(1);
  ExpectStamped<Reply>(*client_, outbound_, reply, [&](const Reply& got) {
    return has(got) && has(got.poses[0]) && has(got.maps[0]) && has(got.jobs[0]) && has(got.robots[0].session) &&
           has(got.robots[0].pose) && has(got.robots[0].ledgers[0]);
  });
}

// What DDS had not taken was counted and forgotten, and its owner believed that it was sent.
TEST_F(EgressTest, AStateThatFindsNoRoomIsSentWhenThereIsSome) {
  constexpr NameId kPlaces = 4096;  // Of the topic.
  Inbox<SessionState> inbox;
  const auto subscription = Must(client_->Subscribe<SessionState>(inbox.Sink()));
  SessionState state;
  for (state.robot_id = 1; state.robot_id <= kPlaces + 1; ++state.robot_id) ASSERT_TRUE(outbound_.SendPatiently(state));
  ASSERT_TRUE(Eventually([&] { return egress_->unpublished() == 1; }));
  state.robot_id = 5;
  ASSERT_TRUE(outbound_.SendPatiently(Retired{state}));
  EXPECT_TRUE(Eventually([&] {
    const auto values = inbox.values();
    return std::any_of(values.begin(), values.end(),
                       [](const SessionState& value) { return value.robot_id == kPlaces + 1; });
  }));
  EXPECT_EQ(egress_->unpublished(), 1U);
}

}  // namespace
}  // namespace cairn::server
