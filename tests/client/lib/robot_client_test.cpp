#include "client/lib/robot_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "tests/client/lib/one_robot.h"

namespace cairn::client {
namespace {

TEST_F(RobotClientTest, StreamsEverythingInOrderAndSeesItSettled) {
  const auto client = Open();
  for (int i = 0; i < 500; ++i) ASSERT_TRUE(client->Publish(SomeScan()));
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(client->Publish(Odometry{}));
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_EQ(server_->received(), OneTo(500));
  EXPECT_TRUE(Eventually([&] { return server_->odometry_received() == 50; }));
  EXPECT_EQ(client->ledger()->settled_through, 500U);
  EXPECT_EQ(client->resent(), 0U);
}

TEST_F(RobotClientTest, HandsOutPosesAndLedgers) {
  std::atomic<int> ledgers = 0;
  std::atomic<std::uint64_t> pose_of = 0;
  const auto client = Open(
      {}, {[&](const Ledger&) { ++ledgers; }, [&](const PoseReport& pose) { pose_of = pose.scan_sequence; }, {}, {}});
  // Poses are not kept for late readers, and the server may find this one only after the first scans.
  EXPECT_TRUE(Eventually([&] { return client->Publish(SomeScan()) && ledgers > 0 && pose_of > 0; }));
  EXPECT_TRUE(Eventually([&] { return client->pose() && client->pose()->reason == PoseReason::kTracking; }));
}

// Another robot had the name before, or another client of this one.
TEST_F(RobotClientTest, APoseOfAnotherSessionIsNotItsOwn) {
  std::atomic<int> wrong = 0;
  const auto client =
      Open({}, {{}, [&](const PoseReport& pose) { wrong += pose.scan_sequence == 1000 ? 1 : 0; }, {}, {}});
  ASSERT_TRUE(Eventually([&] { return client->Publish(SomeScan()) && client->pose(); }));
  const PoseReport own = *client->pose();
  PoseReport other = own;
  other.session = own.session + 1;
  other.scan_sequence = 1000;
  server_->Publish(other);
  ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(Eventually([&] { return client->pose()->scan_sequence > own.scan_sequence; }));
  EXPECT_EQ(wrong, 0);
}

TEST_F(RobotClientTest, ASecondClientOfOneRobotIsRefusedAndTheFirstGoesOn) {
  const auto owner = Open();
  const auto other_bus = MakeBus("impostor");
  const auto second = RobotClient::Open(*other_bus, Robot("r1"), 20.0);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, StatusCode::kAlreadyExists);
  EXPECT_EQ(owner->session().phase, SessionPhase::kActive);
  EXPECT_TRUE(owner->Publish(SomeScan()));
}

TEST_F(RobotClientTest, StopsAtTheWindowUntilTheServerSettles) {
  RobotClientOptions options;
  options.send_timeout_s = 0.2;
  options.resend_after_s = 100.0;
  const auto client = Open(options);
  server_->SetSettling(false);
  for (int i = 0; i < 32; ++i) ASSERT_TRUE(client->Publish(SomeScan())) << i;
  const Result<void> full = client->Publish(SomeScan());
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().code, StatusCode::kUnavailable);
  server_->SetSettling(true);
  ASSERT_TRUE(Eventually([&] { return client->Publish(SomeScan()).has_value(); }));
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_EQ(server_->received(), OneTo(33));
}

TEST_F(RobotClientTest, EachSensorHasAWindowOfItsOwn) {
  RobotClientOptions options;
  options.send_timeout_s = 0.1;
  options.resend_after_s = 100.0;
  const auto client = Open(options);
  server_->SetSettling(false);
  for (int i = 0; i < 32; ++i) ASSERT_TRUE(client->Publish(SomeScan(), "front"));
  EXPECT_FALSE(client->Publish(SomeScan(), "front"));
  EXPECT_TRUE(client->Publish(SomeScan(), "rear"));
  const Result<void> unknown = client->Publish(SomeScan(), "roof");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, StatusCode::kInvalidArgument);
}

TEST_F(RobotClientTest, SendsAgainWhatGotStuck) {
  server_->LoseOnce(5);
  RobotClientOptions options;
  options.resend_after_s = 0.2;
  const auto client = Open(options);
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_GE(client->resent(), 1U);
  EXPECT_THAT(server_->received(), ::testing::UnorderedElementsAreArray(OneTo(10)));
}

// A server settles no scan before it has odometry after it. That odometry may stand behind more scans than are sent
// again at once; where these waited for each other, the stream stood still for ever.
TEST_F(RobotClientTest, WhatTheServerWaitsForComesBehindScansThatDoNotSettle) {
  std::atomic<std::uint64_t> highest = 0;
  const auto ear = MakeBus("ear");
  const auto odometry =
      Must(ear->Subscribe<OdometrySample>([&](OdometrySample&& sample) { highest = sample.odometry.sequence; }));
  server_->SetSettling(false);
  RobotClientOptions options;
  options.resend_after_s = 0.2;
  options.window = 0;
  const auto client = Open(options);
  for (int i = 0; i < 60; ++i) ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(Eventually([&] { return client->resent() >= 32; }));
  ASSERT_TRUE(client->Publish(Odometry{}));
  EXPECT_TRUE(Eventually([&] { return highest == 1; }));
}

// A server waits for numbers that the client does not have any more: they were displaced while the server was away, or
// the server was set back to a saved state.
TEST_F(RobotClientTest, WhatIsGoneHoldsNothingUp) {
  constexpr std::uint64_t kScans = 5000;
  for (std::uint64_t i = 1; i <= kScans; ++i) server_->LoseOnce(i);
  RobotClientOptions options;
  options.resend_after_s = 0.1;
  options.window = 0;
  options.max_kept_bytes = 20'000;
  const auto client = Open(options);
  for (std::uint64_t i = 1; i <= kScans; ++i) ASSERT_TRUE(client->Publish(SomeScan()));
  EXPECT_GT(client->displaced(), kScans - 100);
  const auto arrives = [this](std::uint64_t number) {
    const auto received = server_->received();
    return std::ranges::find(received, number) != received.end();
  };
  EXPECT_TRUE(Eventually([&] { return arrives(kScans); }));
  ASSERT_TRUE(client->Publish(SomeScan()));
  EXPECT_TRUE(Eventually([&] { return arrives(kScans + 1); }));
}

// A lidar is switched off while the rest of the robot goes on. The server calls its stream stale, which is true, and a
// new participant would change nothing.
TEST_F(RobotClientTest, AStreamThatIsNotSentIsNoReasonToJoinAgain) {
  const auto client = Open();
  ASSERT_TRUE(client->Publish(SomeScan(), "rear"));
  ASSERT_TRUE(client->WaitSettled(20.0));
  server_->SayStale();
  ASSERT_TRUE(Eventually([&] { return client->session().stale; }));
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(3);
  while (std::chrono::steady_clock::now() < end) {
    ASSERT_TRUE(client->Publish(SomeScan(), "front"));
    ASSERT_TRUE(client->WaitSettled(20.0));
  }
  EXPECT_EQ(client->renewed(), 0);
  EXPECT_TRUE(client->session().status.ok()) << client->session().status.message;
}

TEST_F(RobotClientTest, GoesOnAfterAServerThatNobodyHeardOfForAWhile) {
  RobotClientOptions options;
  options.window = 0;
  const auto client = Open(options);
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(client->WaitSettled(20.0));
  server_.reset();
  ASSERT_TRUE(Eventually([&] { return !client->connected(); }));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(client->Publish(SomeScan()));  // Kept.
  server_ = std::make_unique<FakeServer>(LoopbackOptions(), 2);
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_EQ(server_->received(), OneTo(100));
}

// `cairn record` reads scans too, and stays when the server goes.
TEST_F(RobotClientTest, ARecorderIsNoServer) {
  RobotClientOptions options;
  options.window = 0;
  const auto client = Open(options);
  const auto recorder = MakeBus("recorder");
  Inbox<ScanSample> recorded;
  const auto scans = Must(recorder->Subscribe<ScanSample>(recorded.Sink()));
  ASSERT_TRUE(Eventually([&] {
    EXPECT_TRUE(client->Publish(SomeScan()));
    return !recorded.values().empty();
  }));
  EXPECT_TRUE(client->connected());
  server_.reset();
  EXPECT_TRUE(Eventually([&] { return !client->connected(); }));
  EXPECT_EQ(scans->matched(), 1);
}

TEST_F(RobotClientTest, AsksAgainUntilItIsAnswered) {
  server_->IgnoreSessions(1);
  const auto client = Open();
  EXPECT_EQ(server_->sessions().size(), 2U);
  EXPECT_EQ(server_->sessions()[0].session, server_->sessions()[1].session);
}

// A robot's program that was started again while its last session was still ending gave up at once.
TEST_F(RobotClientTest, AsksAgainWhereTheServerCannotOpenTheSessionYet) {
  server_->RefuseSessions(2, {StatusCode::kUnavailable, "the last session is still ending"});
  const auto client = Open();
  EXPECT_EQ(client->session().phase, SessionPhase::kActive);
  EXPECT_EQ(server_->sessions().size(), 3U);
}

TEST_F(RobotClientTest, SaysWhyTheServerCouldNotOpenTheSessionInTime) {
  server_->RefuseSessions(1000, {StatusCode::kResourceExhausted, "too many robots"});
  const auto client = RobotClient::Open(*bus_, Robot("r1"), 6.0);
  ASSERT_FALSE(client);
  EXPECT_EQ(client.error().code, StatusCode::kResourceExhausted);
  EXPECT_EQ(client.error().message, "too many robots");
}

// It went on streaming into a session that was another's by then.
TEST_F(RobotClientTest, IsToldThatAnotherClientHasTakenTheRobotOver) {
  const auto client = Open();
  SessionState taken = client->session();
  taken.client = 99;
  taken.session = 99;
  const auto other_server = Must(bus_->Advertise<SessionState>());
  ASSERT_TRUE(Eventually([&] { return other_server->matched() > 0; }));
  ASSERT_TRUE(other_server->Publish(taken));
  ASSERT_TRUE(Eventually([&] { return !client->Publish(SomeScan()); }));
  EXPECT_EQ(client->Publish(SomeScan()).error().code, StatusCode::kAlreadyExists);
  EXPECT_EQ(client->session().phase, SessionPhase::kRefused);
}

// A server that stores: what is settled but not on disk goes again, and only that.
// A program that ended when its scans were settled left a server that was killed right then without the last of them.
TEST_F(RobotClientTest, WaitsUntilScansAndOdometryAreStored) {
  server_->SetDurable(true);
  const auto client = Open();
  ASSERT_TRUE(client->WaitSafe(0.0)) << "nothing was sent";
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 0, .T_odom_robot = {}}));
  ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_EQ(client->WaitSafe(0.1).error().code, StatusCode::kDeadlineExceeded);
  server_->SetDurableThrough(1);
  EXPECT_EQ(client->WaitSafe(0.1).error().code, StatusCode::kDeadlineExceeded);
  server_->SetDurableThrough(2);
  EXPECT_TRUE(client->WaitSafe(20.0));
}

TEST_F(RobotClientTest, WhatIsSettledIsSafeIfTheServerStoresNothing) {
  const auto client = Open();
  ASSERT_TRUE(client->Publish(SomeScan()));
  EXPECT_TRUE(client->WaitSafe(20.0));
}

TEST_F(RobotClientTest, SendsAgainWhatIsNotDurable) {
  server_->SetDurable(true);
  const auto client = Open();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(client->WaitSettled(20.0));
  server_->SetDurableThrough(6);
  ASSERT_TRUE(Eventually([&] { return client->ledger()->durable_through == 6; }));
  server_->Restart(2);  // It knows the session, and what it had stored.
  EXPECT_TRUE(Eventually([&] { return server_->received().size() == 4; }));
  EXPECT_EQ(server_->received(), (std::vector<std::uint64_t>{7, 8, 9, 10}));
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_EQ(client->restarted(), 0);
  EXPECT_EQ(client->resent(), 4U);
}

// The ledger of a server that has believed a damaged number: what was never sent is not safe there.
TEST_F(RobotClientTest, KeepsWhatIsSentAfterALedgerWithAnImpossibleNumber) {
  server_->SetDurable(true);
  const auto client = Open();
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(client->WaitSettled(20.0));
  server_->SetDurableThrough(std::uint64_t{1} << 40);
  ASSERT_TRUE(Eventually([&] { return client->ledger()->durable_through == 3; }));
  server_->SetDurableThrough(4);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(client->Publish(SomeScan()));
  ASSERT_TRUE(client->WaitSettled(20.0));
  ASSERT_TRUE(Eventually([&] { return client->ledger()->durable_through == 4; }));
  server_->Restart(2);
  EXPECT_TRUE(Eventually([&] { return server_->received().size() == 2; }));
  EXPECT_EQ(server_->received(), (std::vector<std::uint64_t>{5, 6}));
}

TEST_F(RobotClientTest, EndsItsSession) {
  const auto client = Open();
  ASSERT_TRUE(client->End(20.0));
  EXPECT_EQ(client->session().phase, SessionPhase::kEnded);
  const Result<void> late = client->Publish(SomeScan());
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, StatusCode::kFailedPrecondition);
}

TEST_F(RobotClientTest, NeedsASensor) {
  SessionRequest request = Robot("r1");
  request.sensors.clear();
  EXPECT_FALSE(RobotClient::Open(*bus_, request, 1.0));
}

TEST(RobotClientAlone, SaysThatNoServerAnswers) {
  const auto bus = MakeBus("robot");
  const auto client = RobotClient::Open(*bus, Robot("r1"), 0.2);
  ASSERT_FALSE(client);
  EXPECT_EQ(client.error().code, StatusCode::kUnavailable);
  EXPECT_EQ(client.error().message,
            "no server answers on domain " + std::to_string(TestDomain()) + " at 127.0.0.1 within 0.2 s");
}

}  // namespace
}  // namespace cairn::client
