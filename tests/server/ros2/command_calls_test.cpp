// Commands of ROS 2 programs on their way to the desk and back.
#include "server/ros2/command_calls.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/outbound.h"
#include "server/ros2/ros2_services.h"

namespace cairn::server {
namespace {

using Clock = CommandCalls::Clock;

class Commands : public ::testing::Test {
 protected:
  void Ask(std::uint64_t asker, RequestKind kind = RequestKind::kSiteSave) {
    Request request;
    request.kind = kind;
    request.site = "lab";
    calls_.Ask(
        asker, std::move(request), [this](const Reply& reply) { replies_.push_back(reply); }, now_);
  }
  // The request that has come first to the desk.
  Request AtTheDesk() { return std::get<Request>(*inbound_.Pop()); }
  static Reply To(const Request& request, StatusCode code = StatusCode::kOk) {
    Reply reply;
    reply.client = request.client;
    reply.sequence = request.sequence;
    reply.status.code = code;
    return reply;
  }

  Inbound inbound_{256};
  CommandCalls calls_{inbound_};
  Clock::time_point now_ = Clock::time_point() + std::chrono::hours(1);
  std::vector<Reply> replies_;
};

TEST_F(Commands, GoToTheDeskAndTheirAnswersComeBackInOrderOfTheirOwn) {
  Ask(7);
  Ask(8);
  const Request first = AtTheDesk(), second = AtTheDesk();
  EXPECT_EQ(first.site, "lab");
  EXPECT_EQ(first.asker, 7U) << "the desk lets participants take turns";
  EXPECT_NE(first.client, 0U);
  EXPECT_EQ(first.client, second.client);
  EXPECT_TRUE(calls_.Take(To(second, StatusCode::kNotFound)));
  calls_.Tick(now_);
  ASSERT_EQ(replies_.size(), 1U);
  EXPECT_EQ(replies_[0].status.code, StatusCode::kNotFound);
  EXPECT_TRUE(calls_.Take(To(first)));
  calls_.Tick(now_);
  ASSERT_EQ(replies_.size(), 2U);
  EXPECT_TRUE(replies_[1].status.ok());
}

TEST_F(Commands, AnAnswerInPartsIsOne) {
  Ask(7, RequestKind::kStatus);
  const Request request = AtTheDesk();
  Reply part = To(request);
  part.robots.resize(2);
  part.last = false;
  EXPECT_TRUE(calls_.Take(part));
  calls_.Tick(now_);
  EXPECT_TRUE(replies_.empty());
  part.last = true;
  EXPECT_TRUE(calls_.Take(part));
  calls_.Tick(now_);
  ASSERT_EQ(replies_.size(), 1U);
  EXPECT_EQ(replies_[0].robots.size(), 4U);
}

TEST_F(Commands, AnswersToOthersAreNotTheirs) {
  Ask(7);
  Reply other = To(AtTheDesk());
  ++other.client;
  EXPECT_FALSE(calls_.Take(other));
}

TEST_F(Commands, TheirAnswersAreNotSentOnTheNativeWire) {
  Outbound outbound(16);
  outbound.Watch([this](const OutboundValue& value) {
    const auto* const reply = std::get_if<Reply>(&value);
    return reply != nullptr && calls_.Take(*reply);
  });
  Ask(7);
  const Request request = AtTheDesk();
  EXPECT_TRUE(outbound.Send(To(request)));
  EXPECT_EQ(outbound.lane(Outbound::Lane::kReplies).size(), 0U);
  Reply other = To(request);
  ++other.client;
  EXPECT_TRUE(outbound.SendPatiently(other));
  EXPECT_EQ(outbound.lane(Outbound::Lane::kReplies).size(), 1U);
}

TEST_F(Commands, OneParticipantCannotTakeAllTheRoom) {
  for (std::size_t i = 0; i < 2 * CommandCalls::kMostOfOne; ++i) Ask(7);
  ASSERT_EQ(replies_.size(), CommandCalls::kMostOfOne) << "those beyond are answered at once";
  EXPECT_EQ(replies_[0].status.code, StatusCode::kResourceExhausted);
  Ask(8);
  EXPECT_EQ(replies_.size(), CommandCalls::kMostOfOne);
  EXPECT_EQ(inbound_.size(), CommandCalls::kMostOfOne + 1);
}

TEST_F(Commands, ThereIsRoomForSoManyOfAllTogether) {
  for (std::uint64_t asker = 1; asker <= 2 * CommandCalls::kMostOpen; ++asker) Ask(asker);
  EXPECT_EQ(inbound_.size(), CommandCalls::kMostOpen);
  EXPECT_EQ(replies_.size(), CommandCalls::kMostOpen);
}

TEST_F(Commands, AServerThatIsBusyIsSaidToBe) {
  Inbound full(0);
  CommandCalls calls(full);
  std::vector<StatusCode> codes;
  for (std::size_t i = 0; i < 2 * CommandCalls::kMostOfOne; ++i) {
    calls.Ask(
        7, Request{}, [&](const Reply& reply) { codes.push_back(reply.status.code); }, now_);
  }
  EXPECT_EQ(codes, std::vector<StatusCode>(2 * CommandCalls::kMostOfOne, StatusCode::kResourceExhausted));
}

TEST_F(Commands, AnAnswerThatDoesNotComeIsGivenUp) {
  Ask(7);
  calls_.Tick(now_ + CommandCalls::kPatience);
  EXPECT_TRUE(replies_.empty());
  calls_.Tick(now_ + CommandCalls::kPatience + std::chrono::seconds(1));
  ASSERT_EQ(replies_.size(), 1U);
  EXPECT_EQ(replies_[0].status.code, StatusCode::kDeadlineExceeded);
  EXPECT_TRUE(calls_.Take(To(AtTheDesk()))) << "one that comes too late is still nobody else's";
}

TEST_F(Commands, WhoIsAnsweredMayAskAgain) {
  int rounds = 0;
  std::function<void(const Reply&)> again = [&](const Reply&) {
    if (++rounds < 3) calls_.Ask(7, Request{}, again, now_);
  };
  calls_.Ask(7, Request{}, again, now_);
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(calls_.Take(To(AtTheDesk())));
    calls_.Tick(now_);
  }
  EXPECT_EQ(rounds, 3);
}

TEST(ServiceResults, AreThoseOfRos) {
  EXPECT_EQ(LoadMapResult({}), 0);
  EXPECT_EQ(LoadMapResult({StatusCode::kNotFound, ""}), 1);
  EXPECT_EQ(LoadMapResult({StatusCode::kInvalidArgument, ""}), 1);
  EXPECT_EQ(LoadMapResult({StatusCode::kDataLoss, ""}), 2);
  EXPECT_EQ(LoadMapResult({StatusCode::kFailedPrecondition, ""}), 3);
  EXPECT_EQ(LoadMapResult({StatusCode::kAlreadyExists, ""}), 255);
  EXPECT_EQ(SaveMapResult({}), 0);
  EXPECT_EQ(SaveMapResult({StatusCode::kNotFound, ""}), 1);
  EXPECT_EQ(SaveMapResult({StatusCode::kResourceExhausted, ""}), 255);
}

}  // namespace
}  // namespace cairn::server
