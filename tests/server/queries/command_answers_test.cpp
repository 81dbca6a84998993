#include "server/queries/command_answers.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>

#include "server/store/sqlite_store.h"
#include "tests/eventually.h"

namespace cairn::server {
namespace {

Request Command(std::int64_t sequence) {
  Request request;
  request.client = 7;
  request.sequence = sequence;
  request.kind = RequestKind::kMapEnable;
  return request;
}

// A disk that stands still for a while must not fill the memory with answers.
TEST(CommandAnswers, WaitForTheDiskAndNotMoreOfThemThanABound) {
  const auto store = *OpenStore(std::string(kInMemory));
  RequestQueue requests(4);
  Journal journal(*store, {.commit_delay_ms = 5});  // Until it is started, nothing is stored.
  const auto answers = std::make_shared<CommandAnswers>(requests, &journal);
  std::int64_t sent = 0;
  while (!answers->full()) {
    ASSERT_LT(sent, 10'000);
    answers->Send(Command(++sent), Reply{});
  }
  EXPECT_GT(sent, 100);
  EXPECT_EQ(requests.size(), 0U);
  journal.Start();
  EXPECT_TRUE(test::Eventually([&] { return requests.size() == static_cast<std::size_t>(sent); }));
  EXPECT_FALSE(answers->full());
  std::set<std::int64_t> answered;
  for (std::int64_t i = 1; i <= sent; ++i) {
    const auto open = requests.Pop();
    ASSERT_TRUE(open && open->rest);
    answered.insert(open->request.sequence);
  }
  EXPECT_EQ(answered.size(), static_cast<std::size_t>(sent));
}

TEST(CommandAnswers, AreSentAtOnceWhereNothingIsStored) {
  RequestQueue requests(4);
  const auto answers = std::make_shared<CommandAnswers>(requests, nullptr);
  answers->Send(Command(1), Reply{});
  EXPECT_EQ(requests.size(), 1U);
  answers->Stop();
  answers->Send(Command(2), Reply{});
  EXPECT_EQ(requests.size(), 1U);
}

}  // namespace
}  // namespace cairn::server
