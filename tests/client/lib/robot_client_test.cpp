#include "client/lib/robot_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "tests/client/lib/fake_server.h"
#include "tests/loopback.h"

namespace cairn::client {
namespace {

using namespace test;

SessionRequest Robot(const std::string& name) {
  SessionRequest request;
  request.robot = name;
  request.site = "hall";
  request.sensors = {"front", "rear"};
  return request;
}

Scan SomeScan() {
  Scan scan;
  scan.ranges_m.assign(180, 1.0F);
  return scan;
}

std::vector<std::uint64_t> OneTo(std::uint64_t n) {
  std::vector<std::uint64_t> numbers(n);
  std::iota(numbers.begin(), numbers.end(), 1);
  return numbers;
}

class RobotClientTest : public ::testing::Test {
 protected:
  std::unique_ptr<RobotClient> Open(const RobotClientOptions& options = {}, RobotClient::Callbacks callbacks = {}) {
    return Must(RobotClient::Open(*bus_, Robot("r1"), 20.0, std::move(callbacks), options));
  }

  std::unique_ptr<FakeServer> server_ = std::make_unique<FakeServer>(LoopbackOptions());
  const std::unique_ptr<wire::Bus> bus_ = MakeBus("robot");
};

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

// A server that began anew put the robot where it had once begun.
constexpr Stamp kStep = kNanosPerSecond / 10;
TEST_F(RobotClientTest, OpensANewSessionWhereTheRobotIsIfTheServerForgotIt) {
  SessionRequest request = Robot("r1");
  request.has_start = true;
  request.T_map_robot_start = {10, 0, 0};
  std::atomic<int> told = 0;
  RobotClient::Callbacks callbacks;
  callbacks.restarted = [&](SessionToken, const Pose2&) { ++told; };
  const auto client = Must(RobotClient::Open(*bus_, request, 20.0, std::move(callbacks)));
  const auto drive = [&](int step) {
    ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = step * kStep, .T_odom_robot = {0.1 * step, 0, 0}}));
    Scan scan = SomeScan();
    scan.stamp = step * kStep;
    ASSERT_TRUE(client->Publish(scan));
  };
  // Poses are not kept for late readers.
  int settled = 0;
  ASSERT_TRUE(Eventually([&] {
    drive(settled++);
    return client->pose().has_value();
  }));
  ASSERT_TRUE(client->WaitSettled(20.0));
  // WaitSettled is about scans. What is not settled of the odometry is sent again as well, with all that came after it.
  ASSERT_TRUE(Eventually([&] {
    const auto odometry = client->ledger("odometry");
    return odometry && odometry->settled_through == static_cast<std::uint64_t>(settled);
  }));
  const SessionToken before = client->session().session;
  server_->SetSettling(false);
  for (int more = 0; more < 5; ++more) drive(settled + more);
  ASSERT_TRUE(Eventually([&] { return server_->received().size() == static_cast<std::size_t>(settled) + 5; }));
  server_.reset();
  server_ = std::make_unique<FakeServer>(LoopbackOptions(), 2);
  drive(settled + 5);
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_EQ(client->restarted(), 1);
  EXPECT_EQ(told, 1);
  // Numbered anew, what was not settled before.
  EXPECT_EQ(server_->received(), OneTo(6));
  EXPECT_EQ(server_->last_scan().scan.stamp, kStep * (settled + 5));
  const SessionRequest first = server_->sessions().front();
  EXPECT_TRUE(first.started);
  EXPECT_EQ(first.session, before);
  const SessionRequest last = server_->sessions().back();
  EXPECT_NE(last.session, before);
  EXPECT_EQ(client->session().session, last.session);
  EXPECT_EQ(client->session().generation, 2U);
  // The fake server's poses say that the frames `map` and `odom` are the same. The robot drives 0.1 m from scan to
  // scan.
  EXPECT_NEAR(last.T_map_robot_start.x, 0.1 * settled, 1e-9);
}

// Its odometry begins anew, or scans are missing for some time, between the last pose and what the next server gets.
TEST_F(RobotClientTest, ARobotThatMayBeElsewhereGivesNoStartToTheNextServer) {
  struct Case {
    const char* what;
    Stamp scan;
    Pose2 T_odom_robot;
    bool has_start;
  };
  for (const Case& one : {Case{"it drives on", 2 * kStep, {5.2, 0, 0}, true},
                          Case{"its odometry begins anew", 2 * kStep, {0, 0, 0}, false},
                          Case{"its odometry jumps", 2 * kStep, {25, 0, 0}, false},
                          Case{"it was watched no longer", 60 * kStep, {5.2, 0, 0}, false}}) {
    SCOPED_TRACE(one.what);
    server_.reset();
    server_ = std::make_unique<FakeServer>(LoopbackOptions(), 1);
    const auto client = Must(RobotClient::Open(*bus_, Robot("r1"), 20.0));
    ASSERT_TRUE(Eventually([&] { return server_->HasPoseReader(); }));
    ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 0, .T_odom_robot = {5, 0, 0}}));
    Scan scan = SomeScan();
    scan.stamp = kStep;
    ASSERT_TRUE(client->Publish(scan));
    ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = kStep, .T_odom_robot = {5.1, 0, 0}}));
    ASSERT_TRUE(client->WaitSettled(20.0));
    ASSERT_TRUE(Eventually([&] { return client->pose().has_value(); }));
    // What is not settled of the odometry would be sent again with the first scan, at which its start is known.
    ASSERT_TRUE(Eventually([&] {
      const auto odometry = client->ledger("odometry");
      return odometry && odometry->settled_through == 2;
    }));
    server_->SetSettling(false);
    scan.stamp = one.scan;
    ASSERT_TRUE(client->Publish(scan));
    ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = one.scan, .T_odom_robot = one.T_odom_robot}));
    ASSERT_TRUE(Eventually([&] { return server_->received().size() == 2; }));
    server_.reset();
    server_ = std::make_unique<FakeServer>(LoopbackOptions(), 2);
    ASSERT_TRUE(client->WaitSettled(20.0));
    EXPECT_EQ(client->restarted(), 1);
    EXPECT_EQ(server_->sessions().back().has_start, one.has_start);
  }
}

// It gave the last pose, of a robot that was lost, as its start, and the server believed it.
TEST_F(RobotClientTest, ALostRobotGivesNoStartToTheNextServer) {
  server_->SetLocalized(false);
  SessionRequest request = Robot("r1");
  request.has_start = true;
  request.T_map_robot_start = {10, 0, 0};
  const auto client = Must(RobotClient::Open(*bus_, request, 20.0));
  ASSERT_TRUE(Eventually([&] { return server_->HasPoseReader(); }));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 0, .T_odom_robot = {5, 0, 0}}));
  Scan scan = SomeScan();
  scan.stamp = 10 * kStep;
  ASSERT_TRUE(client->Publish(scan));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 20 * kStep, .T_odom_robot = {6, 0, 0}}));
  ASSERT_TRUE(Eventually([&] { return client->pose().has_value(); }));
  server_->SetSettling(false);
  scan.stamp = 15 * kStep;
  ASSERT_TRUE(client->Publish(scan));
  ASSERT_TRUE(Eventually([&] { return server_->received().size() == 2; }));
  server_.reset();
  server_ = std::make_unique<FakeServer>(LoopbackOptions(), 2);
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_EQ(client->restarted(), 1);
  EXPECT_FALSE(server_->sessions().back().has_start);
}

TEST_F(RobotClientTest, WithoutAPoseTheFirstStartIsCarriedOnByTheOdometry) {
  SessionRequest request = Robot("r1");
  request.has_start = true;
  request.T_map_robot_start = {10, 0, 0};
  server_->SetSettling(false);  // No poses either.
  const auto client = Must(RobotClient::Open(*bus_, request, 20.0));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 0, .T_odom_robot = {5, 0, 0}}));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 10 * kStep, .T_odom_robot = {7, 0, 0}}));
  Scan scan = SomeScan();
  scan.stamp = 20 * kStep;
  ASSERT_TRUE(client->Publish(scan));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 30 * kStep, .T_odom_robot = {9, 0, 0}}));
  ASSERT_TRUE(Eventually([&] { return server_->received().size() == 1; }));
  server_.reset();
  server_ = std::make_unique<FakeServer>(LoopbackOptions(), 2);
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_NEAR(server_->sessions().back().T_map_robot_start.x, 13.0, 1e-9);
}

TEST_F(RobotClientTest, AsksAgainUntilItIsAnswered) {
  server_->IgnoreSessions(1);
  const auto client = Open();
  EXPECT_EQ(server_->sessions().size(), 2U);
  EXPECT_EQ(server_->sessions()[0].session, server_->sessions()[1].session);
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
