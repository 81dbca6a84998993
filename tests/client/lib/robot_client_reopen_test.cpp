// Where a robot says that it is, to a server that does not know its session.
#include <gtest/gtest.h>

#include <atomic>

#include "tests/client/lib/one_robot.h"

namespace cairn::client {
namespace {

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
  EXPECT_EQ(first.map_frame, FakeServer::kMapFrame);
  EXPECT_EQ(last.map_frame, FakeServer::kMapFrame) << "it must not be believed in another map";
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
    EXPECT_EQ(server_->sessions().back().map_frame, one.has_start ? FakeServer::kMapFrame : 0);
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

// It invented the origin of the map.
TEST_F(RobotClientTest, ARobotThatNeverHadAStartNorAPoseGivesNoneToTheNextServer) {
  server_->SetSettling(false);
  const auto client = Must(RobotClient::Open(*bus_, Robot("r1"), 20.0));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 0, .T_odom_robot = {5, 0, 0}}));
  Scan scan = SomeScan();
  scan.stamp = kStep;
  ASSERT_TRUE(client->Publish(scan));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = kStep, .T_odom_robot = {5.1, 0, 0}}));
  ASSERT_TRUE(Eventually([&] { return server_->received().size() == 1; }));
  server_.reset();
  server_ = std::make_unique<FakeServer>(LoopbackOptions(), 2);
  ASSERT_TRUE(client->WaitSettled(20.0));
  EXPECT_EQ(client->restarted(), 1);
  EXPECT_FALSE(server_->sessions().back().has_start);
}

// A server that does not know the session drops its scans, which settles them. The robot's start was forgotten.
TEST_F(RobotClientTest, ScansThatAServerHasDroppedLeaveTheStartKnown) {
  SessionRequest request = Robot("r1");
  request.has_start = true;
  request.T_map_robot_start = {10, 0, 0};
  server_->SetSettling(false);
  const auto client = Must(RobotClient::Open(*bus_, request, 20.0));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = 0, .T_odom_robot = {5, 0, 0}}));
  Scan scan = SomeScan();
  scan.stamp = kStep;
  ASSERT_TRUE(client->Publish(scan));
  ASSERT_TRUE(client->Publish(Odometry{.sequence = 0, .stamp = kStep, .T_odom_robot = {5.1, 0, 0}}));
  ASSERT_TRUE(Eventually([&] { return server_->received().size() == 1; }));
  const auto other = Must(bus_->Advertise<Ledger>());
  ASSERT_TRUE(Eventually([&] { return other->matched() > 0; }));
  Ledger ledger;
  ledger.robot_id = HashName("r1");
  ledger.sensor_id = HashName("front");
  ledger.received = ledger.last_sequence = ledger.settled_through = 1;
  ledger.dropped[static_cast<std::size_t>(DropReason::kNoSession)] = 1;
  ledger.session = server_->sessions().back().session;
  ledger.generation = 2;
  ASSERT_TRUE(other->Publish(ledger));
  ASSERT_TRUE(Eventually([&] { return client->ledger() && client->ledger()->settled_through == 1; }));
  server_.reset();
  server_ = std::make_unique<FakeServer>(LoopbackOptions(), 2);
  ASSERT_TRUE(Eventually([&] { return server_->received().size() == 1; })) << "it was dropped, so it goes again";
  EXPECT_EQ(client->restarted(), 1);
  EXPECT_TRUE(server_->sessions().back().has_start);
  EXPECT_NEAR(server_->sessions().back().T_map_robot_start.x, 10.1, 1e-9);
}

// The other robots of the fleet came back with the frame of their map, and this one was a stranger in it.
TEST_F(RobotClientTest, AStartThatAServerHasTakenKeepsTheFrameOfItsMap) {
  SessionRequest request = Robot("r1");
  request.has_start = true;
  const auto client = Must(RobotClient::Open(*bus_, request, 20.0));
  server_.reset();
  server_ = std::make_unique<FakeServer>(LoopbackOptions(), 2);
  ASSERT_TRUE(Eventually([&] { return !server_->sessions().empty(); }));
  EXPECT_FALSE(server_->sessions().back().started);
  EXPECT_EQ(server_->sessions().back().map_frame, FakeServer::kMapFrame);
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

}  // namespace
}  // namespace cairn::client
