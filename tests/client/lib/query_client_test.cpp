#include "client/lib/query_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

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
  EXPECT_EQ(Must(client_->Path("r1")).size(), 1U);
  EXPECT_EQ(Must(client_->Path("r1", true)).size(), 2U);
  EXPECT_EQ(Must(client_->Landmarks("hall")).size(), 2U);
  EXPECT_EQ(Must(client_->Maps("hall")).at(0).site, "hall");
  EXPECT_EQ(Must(client_->Robots()).size(), 3U);
  EXPECT_EQ(Must(client_->SubmitJob("hall", JobKind::kSmooth)).id, 42U);
  EXPECT_EQ(Must(client_->GetJob(5)).id, 5U);
  EXPECT_EQ(Must(client_->CancelJob(6)).id, 6U);
  EXPECT_EQ(Must(client_->Jobs()).size(), 2U);
  EXPECT_TRUE(client_->EndSession("r1"));
  EXPECT_FALSE(client_->EnableMap("hall", 3));
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

TEST_F(QueryClientTest, PassesTheServersErrorOn) {
  const Result<void> enabled = client_->EnableMap("hall", 3);
  ASSERT_FALSE(enabled);
  EXPECT_EQ(enabled.error().code, StatusCode::kNotFound);
  EXPECT_EQ(enabled.error().message, "no version 3");
}

TEST_F(QueryClientTest, SaysWhatWasNotAnsweredInTime) {
  ASSERT_TRUE(client_->Ping());
  server_.SetAnswering(false);
  Request request;
  request.kind = RequestKind::kPath;
  const Result<Reply> reply = client_->Ask(request, 0.2);
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, StatusCode::kDeadlineExceeded);
  EXPECT_THAT(reply.error().message, ::testing::HasSubstr("path"));
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
