// What DDS Security refuses, seen from the server's side, against peers that ignore every check of their own side.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/lib/query_client.h"
#include "client/lib/robot_client.h"
#include "tests/client/lib/fake_server.h"
#include "tests/integration/security/fleet_files.h"

namespace cairn {
namespace {

using test::Eventually;
using test::Fleet;
using test::Inbox;
using test::MakeBus;
using test::Must;
using test::SecureOptions;
using ::testing::HasSubstr;

ScanSample ScanOf(const std::string& robot) {
  ScanSample sample;
  sample.stream = {.robot_id = HashName(robot), .sensor_id = HashName("laser"), .session = 3};
  sample.scan.sequence = 1;
  sample.scan.ranges_m.assign(10, 2.0F);
  return sample;
}

Request RequestOf(ClientId client, RequestKind kind) {
  Request request;
  request.client = client;
  request.kind = kind;
  return request;
}

// The server's end of the topics that others write.
class SecureDoors : public ::testing::Test {
 protected:
  void SetUp() override {
    server_ = MakeBus("server", SecureOptions(Fleet() / "server"));
    subscriptions_.push_back(Must(server_->Subscribe<SessionRequest>(sessions_.Sink())));
    subscriptions_.push_back(Must(server_->Subscribe<ScanSample>(scans_.Sink())));
    subscriptions_.push_back(Must(server_->Subscribe<OdometrySample>(odometry_.Sink())));
    subscriptions_.push_back(Must(server_->Subscribe<Request>(requests_.Sink())));
    subscriptions_.push_back(Must(server_->Subscribe<Command>(commands_.Sink())));
  }
  void TearDown() override { subscriptions_.clear(); }

  static ChildProcess Hostile(const std::filesystem::path& member, std::vector<std::string> action) {
    std::vector<std::string> arguments = {CAIRN_HOSTILE_PEER, std::to_string(test::TestDomain()), member.string()};
    arguments.insert(arguments.end(), action.begin(), action.end());
    return ChildProcess(std::move(arguments));
  }
  // A participant and its writers of one topic, one for each robot, or one of a topic that has no robots.
  template <typename Sample>
  struct Member {
    std::unique_ptr<wire::Bus> bus;
    std::vector<std::unique_ptr<wire::Publication<Sample>>> writers;
  };
  // Joins until the server has matched the writers. On a very slow machine a handshake may get stuck: the clients of
  // Cairn then join as a new participant as well.
  template <typename Sample>
  Member<Sample> Join(const std::filesystem::path& identity, const std::vector<std::string>& robots = {}) {
    Member<Sample> member;
    for (int attempt = 0; attempt < 5; ++attempt) {
      member.writers.clear();
      member.bus = MakeBus("member", SecureOptions(identity));
      if (robots.empty()) member.writers.push_back(Must(member.bus->template Advertise<Sample>()));
      for (const std::string& robot : robots)
        member.writers.push_back(Must(member.bus->template Advertise<Sample>(robot)));
      const auto matched = [](const auto& writer) { return writer->matched() == 1; };
      if (Eventually([&] { return std::ranges::all_of(member.writers, matched); }, std::chrono::seconds(15)))
        return member;
    }
    ADD_FAILURE() << identity
                  << " has not been let in; datagrams refused by the server: " << server_->datagrams_refused();
    return member;
  }
  // Waits until a line with this text is said of somebody.
  bool Says(const std::string& text) {
    return Eventually([&] {
      static_cast<void>(server_->refusals());
      for (std::string& line : server_->TakeRefusalLines()) said_ += line + "\n";
      return said_.find(text) != std::string::npos;
    });
  }
  // An honest member's question arrives: by then a hostile one's would have arrived too.
  void HonestQuestionArrives() {
    const std::size_t before = requests_.values().size();
    const auto viewer = Join<Request>(Fleet() / "viewers" / "v");
    Must(viewer.writers[0]->Publish(RequestOf(1, RequestKind::kPing)));
    ASSERT_TRUE(requests_.WaitFor(before + 1));
  }

  std::unique_ptr<wire::Bus> server_;
  Inbox<SessionRequest> sessions_;
  Inbox<ScanSample> scans_;
  Inbox<OdometrySample> odometry_;
  Inbox<Request> requests_;
  Inbox<Command> commands_;
  std::vector<std::unique_ptr<wire::Subscription>> subscriptions_;
  std::string said_;
};

TEST_F(SecureDoors, LetHonestMembersIn) {
  const auto robot = Join<ScanSample>(Fleet() / "robots" / "r1", {"r1"});
  const auto sim = Join<ScanSample>(Fleet() / "robots" / "sim", {"s1", "s2"});
  const auto boss = Join<Command>(Fleet() / "operators" / "o");
  Must(robot.writers[0]->Publish(ScanOf("r1")));
  Must(sim.writers[0]->Publish(ScanOf("s1")));
  Must(sim.writers[1]->Publish(ScanOf("s2")));
  Must(boss.writers[0]->Publish({RequestOf(2, RequestKind::kJobSubmit)}));
  EXPECT_TRUE(scans_.WaitFor(3));
  EXPECT_TRUE(commands_.WaitFor(1));
  HonestQuestionArrives();
  EXPECT_EQ(server_->refusals(), Refusals{.secure = true});
}

TEST_F(SecureDoors, RefuseAParticipantWithoutSecurity) {
  const auto plain = MakeBus("plain");
  const auto requests = Must(plain->Advertise<Request>());
  const auto scans = Must(plain->Advertise<ScanSample>("r1"));
  EXPECT_TRUE(Says("it has no identity: it runs without DDS Security"));
  EXPECT_THAT(said_, HasSubstr("at 127.0.0.1 is refused"));
  HonestQuestionArrives();
  EXPECT_EQ(requests->matched(), 0);
  EXPECT_EQ(scans->matched(), 0);
  EXPECT_EQ(server_->refusals().peers, 1u);
}

TEST_F(SecureDoors, RefuseAnIdentityOfAnotherFleet) {
  ChildProcess stranger = Hostile(test::OtherFleet() / "operators" / "o", {"ask"});
  ASSERT_TRUE(stranger.Says("writing"));
  EXPECT_TRUE(Says("its identity is not valid: unable to get local issuer certificate")) << said_;
  HonestQuestionArrives();
  EXPECT_EQ(requests_.values().size(), 1u);
  EXPECT_EQ(server_->refusals().peers, 1u);
}

TEST_F(SecureDoors, RefuseAnExpiredIdentity) {
  const TempDirectory directory;
  const auto expired = test::CopyOf(Fleet() / "operators" / "o", directory);
  test::Expire(expired, Fleet());
  ChildProcess former = Hostile(expired, {"ask"});
  ASSERT_TRUE(former.Says("writing"));
  EXPECT_TRUE(Says("its identity is not valid: certificate has expired")) << said_;
  HonestQuestionArrives();
  EXPECT_EQ(requests_.values().size(), 1u);
  EXPECT_EQ(server_->refusals().peers, 1u);
}

TEST_F(SecureDoors, RefuseARobotInThePartitionOfAnother) {
  const auto honest = MakeBus("robot", SecureOptions(Fleet() / "robots" / "r2"));
  const auto other = honest->Advertise<ScanSample>("r1");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, StatusCode::kPermissionDenied);

  ChildProcess impostor = Hostile(Fleet() / "robots" / "r2", {"scan", "r1", "r1"});
  ASSERT_TRUE(impostor.Says("writing"));
  EXPECT_TRUE(Says("r1 partition not found in rule")) << said_;
  EXPECT_THAT(said_, HasSubstr("an endpoint of "));
  HonestQuestionArrives();
  EXPECT_TRUE(scans_.values().empty());
  EXPECT_GE(server_->refusals().endpoints, 1u);
}

TEST_F(SecureDoors, RefuseSamplesInTheNameOfAnotherRobot) {
  ChildProcess impostor = Hostile(Fleet() / "robots" / "r2", {"scan", "r1", "r2"});
  ASSERT_TRUE(impostor.Says("matched"));
  EXPECT_TRUE(Says("it writes in the name of another robot than 'r2'")) << said_;
  const auto robot = Join<ScanSample>(Fleet() / "robots" / "r1", {"r1"});
  Must(robot.writers[0]->Publish(ScanOf("r1")));
  ASSERT_TRUE(scans_.WaitFor(1));
  EXPECT_EQ(scans_.values().size(), 1u);
  EXPECT_EQ(scans_.values().front().stream.session, 3u);
  EXPECT_GE(server_->refusals().samples, 1u);
}

// A robot that ended the session of another one would stop it.
TEST_F(SecureDoors, RefuseTheEndOfTheSessionOfAnotherRobot) {
  ChildProcess in_its_own = Hostile(Fleet() / "robots" / "r2", {"end", "r1", "r2"});
  ASSERT_TRUE(in_its_own.Says("matched"));
  EXPECT_TRUE(Says("it writes in the name of another robot than 'r2'")) << said_;
  EXPECT_GE(server_->refusals().samples, 1u);
  ChildProcess in_that_of_the_other = Hostile(Fleet() / "robots" / "r2", {"end", "r1", "r1"});
  ASSERT_TRUE(in_that_of_the_other.Says("writing"));
  EXPECT_TRUE(Says("r1 partition not found in rule")) << said_;
  ChildProcess of_a_viewer = Hostile(Fleet() / "viewers" / "v", {"end", "r1", "r1"});
  ASSERT_TRUE(of_a_viewer.Says("writing"));
  EXPECT_TRUE(Says("cairn/v1/session topic not found in allow rule")) << said_;
  HonestQuestionArrives();
  EXPECT_TRUE(sessions_.values().empty());
  EXPECT_GE(server_->refusals().endpoints, 2u);
}

TEST_F(SecureDoors, RefuseTheOdometryOfAnotherRobot) {
  ChildProcess in_its_own = Hostile(Fleet() / "robots" / "r2", {"odometry", "r1", "r2"});
  ASSERT_TRUE(in_its_own.Says("matched"));
  EXPECT_TRUE(Says("it writes in the name of another robot than 'r2'")) << said_;
  ChildProcess in_that_of_the_other = Hostile(Fleet() / "robots" / "r2", {"odometry", "r1", "r1"});
  ASSERT_TRUE(in_that_of_the_other.Says("writing"));
  EXPECT_TRUE(Says("r1 partition not found in rule")) << said_;
  HonestQuestionArrives();
  EXPECT_TRUE(odometry_.values().empty());
}

// Here a robot must refuse: a member that told poses and maps in the place of the server could lead the robot anywhere.
TEST_F(SecureDoors, RefuseThePosesAndTilesOfWhoIsNotTheServer) {
  const auto honest = Must(server_->Advertise<PoseReport>());
  Inbox<PoseReport> poses;
  Inbox<TileSample> tiles;
  std::unique_ptr<wire::Bus> robot;
  std::unique_ptr<wire::Subscription> read_poses, read_tiles;
  for (int attempt = 0; attempt < 5; ++attempt) {  // As Join does.
    read_poses.reset();
    read_tiles.reset();
    robot = MakeBus("robot", SecureOptions(Fleet() / "robots" / "r1"));
    read_poses = Must(robot->Subscribe<PoseReport>(poses.Sink()));
    read_tiles = Must(robot->Subscribe<TileSample>(tiles.Sink()));
    if (Eventually([&] { return honest->matched() == 1; }, std::chrono::seconds(15))) break;
  }
  ASSERT_EQ(honest->matched(), 1);
  std::string said;
  const auto robot_says = [&](const std::string& text) {
    return Eventually([&] {
      static_cast<void>(robot->refusals());
      for (std::string& line : robot->TakeRefusalLines()) said += line + "\n";
      return said.find(text) != std::string::npos;
    });
  };
  ChildProcess false_poses = Hostile(Fleet() / "viewers" / "v", {"pose", "r1"});
  ChildProcess false_tiles = Hostile(Fleet() / "robots" / "r2", {"tile", "hall"});
  ASSERT_TRUE(false_poses.Says("writing"));
  ASSERT_TRUE(false_tiles.Says("writing"));
  EXPECT_TRUE(robot_says("cairn/v1/pose topic not found in allow rule")) << said;
  EXPECT_TRUE(robot_says("cairn/v1/tile topic not found in allow rule")) << said;
  PoseReport pose;
  pose.robot = "r1";
  pose.robot_id = HashName(pose.robot);
  pose.scan_sequence = 7;
  Must(honest->Publish(pose));
  ASSERT_TRUE(poses.WaitFor(1));
  ASSERT_EQ(poses.values().size(), 1u);
  EXPECT_EQ(poses.values().front().scan_sequence, 7u);
  EXPECT_TRUE(tiles.values().empty());
}

// A wildcard would be in the partition of every robot.
TEST_F(SecureDoors, RefuseAPartitionWithAWildcard) {
  ChildProcess impostor = Hostile(Fleet() / "robots" / "r2", {"scan", "r1", "*"});
  ASSERT_TRUE(impostor.Says("writing"));
  EXPECT_TRUE(Says("* partition not found in rule")) << said_;
  HonestQuestionArrives();
  EXPECT_TRUE(scans_.values().empty());
}

TEST_F(SecureDoors, RefuseTheCommandsOfAViewer) {
  auto viewer = MakeBus("viewer", SecureOptions(Fleet() / "viewers" / "v"));
  const auto client = Must(client::QueryClient::Create(*viewer));
  const auto job = client->SubmitJob("hall", JobKind::kSmooth);
  ASSERT_FALSE(job);
  EXPECT_EQ(job.error().code, StatusCode::kPermissionDenied);

  ChildProcess hostile = Hostile(Fleet() / "viewers" / "v", {"command"});
  ASSERT_TRUE(hostile.Says("writing"));
  EXPECT_TRUE(Says("cairn/v1/command topic not found in allow rule")) << said_;
  HonestQuestionArrives();
  EXPECT_TRUE(commands_.values().empty());
  EXPECT_GE(server_->refusals().endpoints, 1u);
}

TEST_F(SecureDoors, KeepTheStreamsOfARobotFromOthers) {
  for (const char* member : {"robots/r2", "viewers/v", "operators/o"}) {
    const auto bus = MakeBus("reader", SecureOptions(Fleet() / member));
    const auto scans = bus->Subscribe<ScanSample>([](ScanSample&&) {});
    ASSERT_FALSE(scans) << member;
    EXPECT_EQ(scans.error().code, StatusCode::kPermissionDenied) << member;
    EXPECT_FALSE(bus->Advertise<PoseReport>()) << member;
  }
}

// A client that the server does not hear joins as another participant, which proves the same identity.
TEST(SecureClients, JoinAgainWithTheirIdentity) {
  test::FakeServer server(SecureOptions(Fleet() / "server"));
  const auto bus = MakeBus("robot", SecureOptions(Fleet() / "robots" / "r1"));
  SessionRequest request;
  request.robot = "r1";
  request.site = "hall";
  request.sensors = {"laser"};
  const auto robot = Must(client::RobotClient::Open(*bus, request, 30.0));
  server.SetSettling(false);  // Nothing seems to arrive.
  Scan scan;
  scan.ranges_m.assign(10, 2.0F);
  Must(robot->Publish(scan));
  ASSERT_TRUE(Eventually([&] { return robot->renewed() > 0; }));
  server.SetSettling(true);
  Must(robot->WaitSettled(20.0));
  EXPECT_EQ(server.received(), std::vector<std::uint64_t>{1});
}

// Where several joined at the same time, one in seventy was never let in by Fast DDS 2.9.
TEST_F(SecureDoors, LetInMembersThatJoinAtTheSameTime) {
  constexpr int kMembers = 6, kRounds = 5;
  std::atomic<int> let_in{0};
  {
    std::vector<std::jthread> members;
    for (int i = 0; i < kMembers; ++i) {
      members.emplace_back([&, identity = Fleet() / (i % 2 == 0 ? "viewers/v" : "operators/o")] {
        for (int round = 0; round < kRounds; ++round) {
          const auto bus = MakeBus("member", SecureOptions(identity));
          const auto writer = Must(bus->Advertise<Request>());
          if (Eventually([&] { return writer->matched() == 1; }, std::chrono::seconds(60))) ++let_in;
        }
      });
    }
  }
  EXPECT_EQ(let_in, kMembers * kRounds);
}

// A handshake that is stuck looks to a client as if there were no server.
TEST(SecureClients, JoinAgainWhereNoServerIsFound) {
  auto server = std::make_unique<test::FakeServer>(SecureOptions(Fleet() / "server"));
  const auto bus = MakeBus("robot", SecureOptions(Fleet() / "robots" / "r1"));
  SessionRequest request;
  request.robot = "r1";
  request.site = "hall";
  request.sensors = {"laser"};
  const auto robot = Must(client::RobotClient::Open(*bus, request, 30.0));
  server.reset();
  const auto queries = Must(client::QueryClient::Create(*bus, {.timeout_s = 9.0}));
  EXPECT_FALSE(queries->Ping());
  EXPECT_GE(queries->renewed(), 1);
  EXPECT_TRUE(Eventually([&] { return robot->renewed() > 0; }));
  server = std::make_unique<test::FakeServer>(SecureOptions(Fleet() / "server"));
  Scan scan;
  scan.ranges_m.assign(10, 2.0F);
  Must(robot->Publish(scan));
  Must(robot->WaitSettled(150.0));
}

}  // namespace
}  // namespace cairn
