#include "client/lib/query_client.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <set>
#include <string_view>
#include <thread>
#include <vector>

#include "client/lib/last_request.h"
#include "tests/client/lib/fake_server.h"
#include "tests/loopback.h"

namespace cairn::client {
namespace {

using namespace test;

class QueryClientTest : public ::testing::Test {
 protected:
  FakeServer server_{LoopbackOptions()};
  const std::unique_ptr<wire::Bus> bus_ = MakeBus("client");
  const std::unique_ptr<QueryClient> client_ = Must(QueryClient::Create(*bus_, {.timeout_s = 20.0}));
};

TEST_F(QueryClientTest, AsksEveryKindOfQuestion) {
  EXPECT_EQ(Must(client_->Ping()), "fake");
  EXPECT_EQ(Must(client_->Pose("r1")).stamp, -1);
  EXPECT_EQ(Must(client_->Pose("r1", 77)).stamp, 77);
  EXPECT_EQ(Must(client_->Path("r1")).poses.size(), 1U);
  EXPECT_EQ(Must(client_->Path("r1", true)).poses.size(), 2U);
  EXPECT_EQ(Must(client_->Landmarks("hall")).size(), 2U);
  EXPECT_EQ(Must(client_->Maps()).size(), 1U);
  EXPECT_EQ(Must(client_->Map("hall")).site, "hall");
  EXPECT_EQ(Must(client_->Robots()).size(), 3U);
  EXPECT_EQ(Must(client_->SubmitJob("hall", JobKind::kSmooth)).id, 42U);
  EXPECT_EQ(Must(client_->GetJob(5)).id, 5U);
  EXPECT_EQ(Must(client_->CancelJob(6)).id, 6U);
  EXPECT_EQ(Must(client_->Jobs()).size(), 2U);
  EXPECT_TRUE(client_->EndSession("r1"));
  EXPECT_TRUE(client_->Relocalise("r1", Pose2{1.5, -2.0, kPi / 2}));
  EXPECT_FALSE(client_->Relocalise("r1"));
  EXPECT_TRUE(client_->Localise("robot1"));
  EXPECT_TRUE(client_->MapAgain("robot1"));
  EXPECT_EQ(client_->Localise("robot9").error().code, StatusCode::kNotFound);
  EXPECT_EQ(client_->MapAgain("robot9").error().code, StatusCode::kNotFound);
}

TEST_F(QueryClientTest, PutsThePartsOfAnAnswerTogether) {
  TileQuery query;
  query.site = "hall";
  const TileAnswer answer = Must(client_->Tiles(query));
  EXPECT_EQ(answer.epoch, 3U);
  EXPECT_EQ(answer.version, 9U);
  ASSERT_EQ(answer.tiles.size(), FakeServer::kTileParts);
  for (std::size_t i = 0; i < answer.tiles.size(); ++i) EXPECT_EQ(answer.tiles[i].key.x, static_cast<int>(i));
}

TEST_F(QueryClientTest, AMapImageIsTheTilesOfTheFinestLevelPutTogether) {
  const OccupancyImage image = Must(client_->MapImage("drawn"));
  EXPECT_EQ(image.width, kTileCells);
  EXPECT_EQ(image.height, kTileCells);
  EXPECT_EQ(image.resolution_m, 0.1) << "the map's, not the default";
  EXPECT_EQ(image.cells.at(0), 100);
}

TEST_F(QueryClientTest, SwitchesToAMapVersionAndBack) {
  EXPECT_EQ(Must(client_->RollBackMap("hall")).enabled_version, 2U);
  EXPECT_EQ(Must(client_->RollBackMap("hall")).enabled_version, 1U);
  const Result<MapInfo> none = client_->RollBackMap("hall");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, StatusCode::kFailedPrecondition);
  EXPECT_EQ(Must(client_->EnableMap("hall", 3)).enabled_version, 3U);
}

TEST_F(QueryClientTest, EditsOfAMapAreListedAddedAndRemoved) {
  EXPECT_EQ(Must(client_->MapEdits("hall")).size(), 2U);
  EXPECT_EQ(client_->MapEdits("moon").error().code, StatusCode::kInternal) << "its points are far away";
  const MapEdit wall{.kind = MapEditKind::kOccupied, .points_map = {{0, 0}, {1, 2}}, .width_m = 0.1, .note = "glass"};
  const MapEdit added = Must(client_->AddMapEdit("hall", wall));
  EXPECT_EQ(added.id, 5U);
  EXPECT_EQ(added.points_map, wall.points_map);
  EXPECT_TRUE(client_->RemoveMapEdit("hall", 5));
  EXPECT_EQ(client_->RemoveMapEdit("hall", 6).error().code, StatusCode::kNotFound);
}

TEST_F(QueryClientTest, WaitsForAJobUntilItEndsOrTheCallerHasEnough) {
  int running = 0;
  const Job ended = Must(client_->WaitForJob(5, [&](const Job& job) { return ++running, !IsFinal(job.state); }));
  EXPECT_EQ(ended.state, JobState::kSucceeded);
  EXPECT_EQ(running, FakeServer::kAnswersUntilJobEnds - 1);
  EXPECT_EQ(Must(client_->WaitForJob(6, [](const Job&) { return false; })).state, JobState::kRunning);
  server_.SetAnswering(false);
  const auto impatient = Must(QueryClient::Create(*bus_, {.timeout_s = 0.2}));
  EXPECT_FALSE(impatient->WaitForJob(7)) << "a server that does not answer ends the wait";
}

TEST_F(QueryClientTest, PassesTheServersErrorOn) {
  const Result<MapInfo> enabled = client_->EnableMap("hall", 7);
  ASSERT_FALSE(enabled);
  EXPECT_EQ(enabled.error().code, StatusCode::kNotFound);
  EXPECT_EQ(enabled.error().message, "no version 7");
  EXPECT_EQ(enabled.error().request, TakeLastRequest());
}

TEST_F(QueryClientTest, SaysWhatWasNotAnsweredInTime) {
  const auto impatient = Must(QueryClient::Create(*bus_, {.timeout_s = 0.2}));
  int asked = 0;  // Until the two have found each other, which takes as long as the machine is busy.
  while (!impatient->Ping()) ASSERT_LT(++asked, 100);
  server_.SetAnswering(false);
  static_cast<void>(TakeLastRequest());  // A command of another test would count before a question.
  const Result<PathAnswer> path = impatient->Path("r1");
  ASSERT_FALSE(path);
  EXPECT_EQ(path.error().code, StatusCode::kDeadlineExceeded);
  EXPECT_EQ(path.error().message, "no answer to path within 0.2 s");
  EXPECT_EQ(path.error().request, TakeLastRequest());
}

TEST_F(QueryClientTest, AsksWhatTheDoorForRos2Sees) {
  const Ros2Report report = Must(client_->Ros2());
  EXPECT_TRUE(report.door.enabled);
  EXPECT_EQ(report.door.domain, 5);
  ASSERT_EQ(report.namespaces.size(), 1U);
  EXPECT_EQ(report.namespaces[0].name, "/r1");
  EXPECT_EQ(report.namespaces[0].problems, std::vector<std::string>{"no odometry"});
}

TEST_F(QueryClientTest, SavesLoadsAndDeletesSites) {
  EXPECT_EQ(Must(client_->SavedSites()).size(), 2U);
  const SavedSite saved = Must(client_->SaveSite("hall", "monday"));
  EXPECT_EQ(saved.site, "hall");
  EXPECT_EQ(saved.name, "monday");
  EXPECT_EQ(saved.bytes, 77U);
  EXPECT_TRUE(client_->LoadSite("monday", "hall"));
  EXPECT_EQ(client_->LoadSite("tuesday", "hall").error().code, StatusCode::kNotFound);
  EXPECT_TRUE(client_->DeleteSite("hall"));
  EXPECT_EQ(client_->DeleteSite("annex").error().code, StatusCode::kNotFound);
  EXPECT_TRUE(client_->DeleteSavedSite("monday"));
  EXPECT_EQ(client_->DeleteSavedSite("hall").error().code, StatusCode::kNotFound);
}

// While DDS matches both sides, the answer to the first question is often lost.
TEST_F(QueryClientTest, SendsTheFirstPingAgainSoonAndWaitsOnForItsAnswer) {
  server_.IgnorePings(6);
  EXPECT_EQ(Must(client_->Ping()), "fake");
  const std::vector<std::uint64_t> pings = server_.pings();
  EXPECT_GE(pings.size(), 7U);
  EXPECT_NE(std::adjacent_find(pings.begin(), pings.end()), pings.end()) << "no ping was sent twice";
}

// Four hundred threads of eight clients pinged at once, and a busy server answered hardly any question.
TEST_F(QueryClientTest, OneThreadSendsPingsForAllThatWait) {
  constexpr int kThreads = 50;
  server_.IgnorePings(60);
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) threads.emplace_back([this] { EXPECT_TRUE(client_->Maps()); });
  }
  const std::vector<std::uint64_t> pings = server_.pings();
  EXPECT_LT(std::set<std::uint64_t>(pings.begin(), pings.end()).size(), kThreads / 2) << "sent again counts once";
}

// A question that does something must not be asked twice, however slowly the two sides find each other.
TEST_F(QueryClientTest, SubmitsAJobOnce) {
  ASSERT_TRUE(client_->SubmitJob("hall", JobKind::kSmooth));
  const std::vector<RequestKind> asked = server_.asked();
  EXPECT_EQ(std::count(asked.begin(), asked.end(), RequestKind::kJobSubmit), 1);
}

TEST_F(QueryClientTest, ManyThreadsAskAtOnce) {
  std::vector<std::thread> threads;
  std::atomic<int> right = 0;
  for (std::uint64_t thread = 0; thread < 8; ++thread) {
    threads.emplace_back([&, thread] {
      for (std::uint64_t i = 0; i < 20; ++i) {
        const Result<Job> job = client_->GetJob(100 * thread + i);
        if (job && job->id == 100 * thread + i) ++right;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 160);
}

// A datagram that every participant of the test's domain refuses: its only submessage says that it is longer.
void SendRefusedDatagram() {
  constexpr std::string_view kBytes(
      "RTPS\x02\x03\x01\x0f"
      "BBBBBBBBBBBB"
      "\x15\x01\xf0\x00",
      24);
  const int sender = socket(AF_INET, SOCK_DGRAM, 0);
  const in_addr loopback{htonl(INADDR_LOOPBACK)};
  setsockopt(sender, IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof(loopback));
  sockaddr_in group{};  // Where participants announce themselves (RTPS 9.6.1).
  group.sin_family = AF_INET;
  group.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * TestDomain()));
  group.sin_addr.s_addr = inet_addr("239.255.0.1");
  sendto(sender, kBytes.data(), kBytes.size(), 0, reinterpret_cast<const sockaddr*>(&group), sizeof(group));
  close(sender);
}

// Also if the forged messages came long before the question.
TEST(QueryClientAlone, JoinsAnewOnceWhereForgedMessagesMayHaveMadeItDeaf) {
  const auto bus = MakeBus("client");
  const auto client = Must(QueryClient::Create(*bus, {.timeout_s = 8.0}));
  ASSERT_TRUE(Eventually([&] {
    SendRefusedDatagram();
    return bus->datagrams_refused() > 0;
  }));
  EXPECT_FALSE(client->Ping());
  EXPECT_EQ(client->renewed(), 1);
}

TEST(QueryClientAlone, DoesNotJoinAnewWhereThereIsNoServer) {
  const auto bus = MakeBus("client");
  const auto client = Must(QueryClient::Create(*bus, {.timeout_s = 3.0}));
  EXPECT_FALSE(client->Ping());
  EXPECT_EQ(client->renewed(), 0);
}

TEST(QueryClientAlone, SaysThatNoServerAnswers) {
  const auto bus = MakeBus("client");
  const auto client = Must(QueryClient::Create(*bus, {.timeout_s = 0.2}));
  const Result<std::string> pong = client->Ping();
  ASSERT_FALSE(pong);
  EXPECT_EQ(pong.error().code, StatusCode::kUnavailable);
  EXPECT_THAT(pong.error().message, ::testing::StartsWith("no server answers on domain"));
}

}  // namespace
}  // namespace cairn::client
