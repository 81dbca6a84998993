// The door of a server that does not keep up, over real DDS on loopback: nothing waits, what asks for an answer is
// answered at once, and everything is counted.
#include "server/ingress/ingress.h"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <variant>

#include "tests/loopback.h"

namespace cairn::server {
namespace {

using test::Eventually;
using test::Must;

constexpr ClientId kAsker = 7;

class FullDoor : public ::testing::Test {
 protected:
  static constexpr std::size_t kRoom = 2;

  // The next value that the door sends.
  std::optional<OutboundValue> Next(Outbound::Lane lane) {
    std::optional<OutboundValue> value;
    static_cast<void>(Eventually([&] { return (value = outbound_.lane(lane).TryPop()).has_value(); }));
    return value;
  }
  static Request Ask(RequestKind kind, std::int64_t sequence) {
    Request request;
    request.kind = kind;
    request.client = kAsker;
    request.sequence = sequence;
    return request;
  }

  Inbound inbound_{kRoom};  // Nobody takes anything out.
  Outbound outbound_{8};
  const std::unique_ptr<wire::Bus> bus_ = test::MakeBus("cairnd");
  const std::unique_ptr<Ingress> ingress_ = Must(Ingress::Open(*bus_, inbound_, outbound_));
  const std::unique_ptr<wire::Bus> peer_ = test::MakeBus("peer");
};

TEST_F(FullDoor, AnswersAQuestionBusyAndCountsIt) {
  const auto questions = Must(peer_->Advertise<Request>());
  ASSERT_TRUE(Eventually([&] { return questions->matched() == 1; }));
  for (std::int64_t sequence = 1; sequence <= 3; ++sequence)
    Must(questions->Publish(Ask(RequestKind::kPing, sequence)));
  const auto sent = Next(Outbound::Lane::kReplies);
  ASSERT_TRUE(sent && std::holds_alternative<Reply>(*sent));
  const Reply& busy = std::get<Reply>(*sent);
  EXPECT_EQ(busy.client, kAsker);
  EXPECT_EQ(busy.sequence, 3);
  EXPECT_EQ(busy.status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(ingress_->overflow(), 1U);
  EXPECT_EQ(outbound_.over_limit(), 1U);
  EXPECT_EQ(inbound_.size(), kRoom);
}

TEST_F(FullDoor, AnswersACommandBusyAndCountsIt) {
  const auto commands = Must(peer_->Advertise<Command>());
  ASSERT_TRUE(Eventually([&] { return commands->matched() == 1; }));
  for (std::int64_t sequence = 1; sequence <= 3; ++sequence)
    Must(commands->Publish(Command{Ask(RequestKind::kJobSubmit, sequence)}));
  const auto sent = Next(Outbound::Lane::kReplies);
  ASSERT_TRUE(sent && std::holds_alternative<Reply>(*sent));
  EXPECT_EQ(std::get<Reply>(*sent).sequence, 3);
  EXPECT_EQ(std::get<Reply>(*sent).status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(ingress_->overflow(), 1U);
}

TEST_F(FullDoor, AnswersASessionRequestBusyAndCountsIt) {
  const auto of = [](const std::string& robot) {
    SessionRequest request;
    request.robot = robot;
    request.site = "hall";
    request.sensors = {"laser"};
    request.client = kAsker;
    request.session = 5;
    return request;
  };
  for (std::size_t i = 0; i < Inbound::kMaxControl; ++i) ASSERT_TRUE(inbound_.TryPush(of("r" + std::to_string(i))));
  const auto requests = Must(peer_->Advertise<SessionRequest>());
  ASSERT_TRUE(Eventually([&] { return requests->matched() == 1; }));
  Must(requests->Publish(of("late")));
  const auto sent = Next(Outbound::Lane::kLive);
  ASSERT_TRUE(sent && std::holds_alternative<SessionRefusal>(*sent));
  const SessionState& state = std::get<SessionRefusal>(*sent).state;
  EXPECT_EQ(state.robot, "late");
  EXPECT_EQ(state.client, kAsker);
  EXPECT_EQ(state.session, 5U);
  EXPECT_EQ(state.phase, SessionPhase::kRefused);
  EXPECT_EQ(state.status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(ingress_->overflow(), 1U);
}

TEST_F(FullDoor, CountsScansThatFindNoRoomAndAQuestionIsStillAnswered) {
  const auto scans = Must(peer_->Advertise<ScanSample>());
  const auto questions = Must(peer_->Advertise<Request>());
  ASSERT_TRUE(Eventually([&] { return scans->matched() == 1 && questions->matched() == 1; }));
  ScanSample sample;
  sample.stream = {HashName("r1"), HashName("laser"), 5};
  sample.scan.angle_step_rad = 0.1;
  sample.scan.range_max_m = 10.0;
  sample.scan.ranges_m.assign(8, 1.0F);
  for (sample.scan.sequence = 1; sample.scan.sequence <= 5; ++sample.scan.sequence) Must(scans->Publish(sample));
  EXPECT_TRUE(Eventually([&] { return ingress_->overflow() == 3; })) << ingress_->overflow();
  Must(questions->Publish(Ask(RequestKind::kPing, 1)));
  EXPECT_TRUE(Eventually([&] { return inbound_.size() == kRoom + 1; })) << "the lanes have rooms of their own";
}

}  // namespace
}  // namespace cairn::server
