// Answers that many viewers ask for, and what happens when the server is slow.
#include "client/web/answer_cache.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

#include "tests/eventually.h"

namespace cairn::web {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

TEST(AnswerCache, AnAnswerIsGivenAgainUntilItIsOld) {
  int asked = 0;
  const auto ask = [&]() -> Result<std::string> { return "answer " + std::to_string(++asked); };
  AnswerCache lasting(hours(1), 8);
  EXPECT_EQ(**lasting.Get("a", ask), "answer 1");
  EXPECT_EQ(**lasting.Get("a", ask), "answer 1");
  EXPECT_EQ(**lasting.Get("b", ask), "answer 2");
  AnswerCache passing(milliseconds(0), 8);
  EXPECT_EQ(**passing.Get("a", ask), "answer 3");
  EXPECT_TRUE(test::Eventually([&] { return **passing.Get("a", ask) != "answer 3"; }));
}

TEST(AnswerCache, AnErrorIsPassedOnAndNotKept) {
  AnswerCache cache(hours(1), 8);
  const auto fails = []() -> Result<std::string> { return Fail(StatusCode::kNotFound, "no such robot"); };
  EXPECT_EQ(cache.Get("a", fails).error().code, StatusCode::kNotFound);
  EXPECT_EQ(**cache.Get("a", [] { return Result<std::string>("there"); }), "there");
}

// Everybody else would wait for ever.
TEST(AnswerCache, AnExceptionEndsTheTurn) {
  AnswerCache cache(hours(1), 8);
  EXPECT_THROW(static_cast<void>(cache.Get("a", []() -> Result<std::string> { throw std::runtime_error("no"); })),
               std::runtime_error);
  EXPECT_EQ(**cache.Get("a", [] { return Result<std::string>("there"); }), "there");
}

TEST(AnswerCache, KeepsNoMoreThanItMay) {
  AnswerCache cache(hours(1), 1);
  int asked = 0;
  const auto ask = [&]() -> Result<std::string> { return std::to_string(++asked); };
  EXPECT_EQ(**cache.Get("a", ask), "1");
  EXPECT_EQ(**cache.Get("b", ask), "2");
  EXPECT_EQ(**cache.Get("b", ask), "3");
  EXPECT_EQ(**cache.Get("a", ask), "1");
}

// While one question has no answer yet, others wait: as many as may, and the next one is refused at once.
TEST(AnswerCache, OneQuestionAtATimeAndFewWait) {
  AnswerCache cache(hours(1), 64);
  std::atomic<bool> answered = false;
  std::atomic<int> refused = 0, asking = 0, most_asking = 0;
  const auto slow = [&]() -> Result<std::string> {
    most_asking = std::max(most_asking.load(), ++asking);
    answered.wait(false);
    --asking;
    return std::string("late");
  };
  std::vector<std::thread> viewers;
  for (int i = 0; i < AnswerCache::kMaxWaiting + 4; ++i) {
    viewers.emplace_back([&, i] {
      if (!cache.Get(std::to_string(i), slow)) ++refused;
    });
  }
  EXPECT_TRUE(test::Eventually([&] { return refused == 3; })) << "one asks, " << AnswerCache::kMaxWaiting << " wait";
  answered = true;
  answered.notify_all();
  for (std::thread& viewer : viewers) viewer.join();
  EXPECT_EQ(refused, 3);
  EXPECT_EQ(most_asking, 1);
}

}  // namespace
}  // namespace cairn::web
