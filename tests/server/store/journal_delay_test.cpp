// When the journal commits: what comes within store.commit_delay_ms is one commit, and none comes later than that.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "server/store/journal.h"
#include "server/store/sqlite_store.h"
#include "tests/eventually.h"
#include "tests/server/store/followed.h"
#include "tests/server/store/sample_entries.h"

namespace cairn::server::testing {
namespace {

TEST(Journal, GathersWhatComesWithinTheDelayIntoOneCommit) {
  const auto store = *OpenStore(std::string(kInMemory));
  Followed told;
  Journal journal(*store, {.commit_delay_ms = 10000});
  journal.Start();
  journal.Open(SampleSession(1), told.durable());
  EXPECT_TRUE(test::Eventually([&] { return told.through == 0; }));  // A new session does not wait for the delay.
  for (std::uint64_t i = 1; i <= 100; ++i) journal.Append(1, SampleOdometry(i));
  journal.Stop();  // What waits is written.
  EXPECT_EQ(told.through, 100);
  EXPECT_EQ(journal.counts().commits, 2U);
  EXPECT_EQ(StoredEntries(*store, 1), 100U);
}

// The delay counts from the first change of a group: what comes later neither makes it longer nor starts it again.
TEST(Journal, ChangesThatKeepComingDoNotPutOffTheCommit) {
  const auto store = *OpenStore(std::string(kInMemory));
  Followed told;
  Journal journal(*store, {.commit_delay_ms = 100});
  journal.Start();
  journal.Open(SampleSession(1), told.durable());
  ASSERT_TRUE(test::Eventually([&] { return told.through == 0; }));
  std::atomic<bool> enough = false;
  std::thread robot([&] {
    for (std::uint64_t i = 1; !enough; ++i) {
      journal.Append(1, SampleOdometry(i));
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  const std::uint64_t before = journal.counts().commits;
  EXPECT_TRUE(test::Eventually([&] { return journal.counts().commits >= before + 5; }));
  enough = true;
  robot.join();
  EXPECT_GT(told.through, 0);
}

}  // namespace
}  // namespace cairn::server::testing
