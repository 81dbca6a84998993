#include "server/queries/request_queue.h"

#include <gtest/gtest.h>

#include <thread>

namespace cairn::server {
namespace {

Request From(ClientId client, std::int64_t sequence) {
  Request request;
  request.client = client;
  request.sequence = sequence;
  return request;
}

std::pair<ClientId, std::int64_t> Next(RequestQueue& queue) {
  const auto open = queue.Pop();
  return open ? std::pair(open->request.client, open->request.sequence) : std::pair(ClientId{0}, std::int64_t{0});
}

using Turn = std::pair<ClientId, std::int64_t>;

TEST(RequestQueue, ClientsTakeTurns) {
  RequestQueue queue(10);
  for (std::int64_t i = 1; i <= 3; ++i) EXPECT_FALSE(queue.Push(From(7, i)));
  EXPECT_FALSE(queue.Push(From(8, 1)));
  EXPECT_EQ(queue.size(), 4U);
  EXPECT_EQ(Next(queue), Turn(7, 1));
  EXPECT_EQ(Next(queue), Turn(8, 1));
  EXPECT_EQ(Next(queue), Turn(7, 2));
  EXPECT_EQ(Next(queue), Turn(7, 3));
  EXPECT_EQ(queue.taken(), 4U);
}

// Whoever gave a command would have been told to give it again.
TEST(RequestQueue, AnAnswerDoesNotGiveWay) {
  RequestQueue queue(2);
  for (std::int64_t i = 1; i <= 4; ++i) queue.PutBack({From(7, i), ReplyParts(Answer(Reply{}))});
  const auto refused = queue.Push(From(8, 1));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->client, 8U);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(queue.Pop()->rest);
  EXPECT_FALSE(queue.Push(From(9, 1)));
  EXPECT_FALSE(queue.Push(From(9, 2)));
  for (std::int64_t i = 1; i <= 4; ++i) queue.PutBack({From(7, i), ReplyParts(Answer(Reply{}))});
  EXPECT_EQ(queue.Push(From(8, 2))->client, 9U) << "of those who wait for an answer, the one with most gives way";
}

TEST(RequestQueue, AnAnswerGoesOnBeforeTheClientsOtherRequestsAndAfterOtherClients) {
  RequestQueue queue(10);
  for (std::int64_t i = 1; i <= 2; ++i) EXPECT_FALSE(queue.Push(From(7, i)));
  EXPECT_FALSE(queue.Push(From(8, 1)));
  auto open = queue.Pop();
  ASSERT_TRUE(open);
  open->rest.emplace(Answer(Reply{}));
  queue.PutBack(*std::move(open));
  EXPECT_EQ(Next(queue), Turn(8, 1));
  open = queue.Pop();
  ASSERT_TRUE(open);
  EXPECT_EQ(open->request.sequence, 1);
  EXPECT_TRUE(open->rest);
  EXPECT_EQ(Next(queue), Turn(7, 2));
}

TEST(RequestQueue, AFullQueueRefusesTheClientWithMostWaiting) {
  RequestQueue queue(4);
  for (std::int64_t i = 1; i <= 4; ++i) EXPECT_FALSE(queue.Push(From(7, i)));
  const auto flooder = queue.Push(From(7, 5));
  ASSERT_TRUE(flooder);
  EXPECT_EQ(flooder->sequence, 5);
  for (std::int64_t i = 1; i <= 2; ++i) {
    const auto refused = queue.Push(From(8, i));
    ASSERT_TRUE(refused);
    EXPECT_EQ(refused->client, 7U);
    EXPECT_EQ(refused->sequence, 5 - i);
  }
  const auto equal = queue.Push(From(8, 3));
  ASSERT_TRUE(equal);
  EXPECT_EQ(equal->client, 8U);
  EXPECT_EQ(queue.size(), 4U);
  EXPECT_EQ(Next(queue), Turn(7, 1));
  EXPECT_EQ(Next(queue), Turn(8, 1));
}

TEST(RequestQueue, CloseLetsOutWhatIsInside) {
  RequestQueue queue(4);
  EXPECT_FALSE(queue.Push(From(7, 1)));
  queue.Close();
  EXPECT_TRUE(queue.Push(From(7, 2)));
  EXPECT_EQ(Next(queue), Turn(7, 1));
  EXPECT_FALSE(queue.Pop());
  RequestQueue empty(1);
  std::thread waiting([&] { EXPECT_FALSE(empty.Pop()); });
  empty.Close();
  waiting.join();
}

// A program can invent a client for each question; its participant it cannot.
TEST(RequestQueue, SharesGoByWhoAsksAndNotByTheClientsItNames) {
  RequestQueue queue(4);
  const auto from = [](std::uint64_t asker, ClientId client, std::int64_t sequence) {
    Request request = From(client, sequence);
    request.asker = asker;
    return request;
  };
  for (std::int64_t i = 1; i <= 4; ++i) EXPECT_FALSE(queue.Push(from(1, 100 + static_cast<ClientId>(i), i)));
  const auto refused = queue.Push(from(2, 7, 1));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->client, 104U);
  EXPECT_EQ(Next(queue), Turn(101, 1));
  EXPECT_EQ(Next(queue), Turn(7, 1)) << "the next turn is another's";
  EXPECT_EQ(Next(queue), Turn(102, 2));
}

}  // namespace
}  // namespace cairn::server
