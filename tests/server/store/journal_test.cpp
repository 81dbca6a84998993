#include "server/store/journal.h"

#include <gtest/gtest.h>

#include <atomic>

#include "server/store/sqlite_store.h"
#include "tests/eventually.h"
#include "tests/server/store/faulty_vfs.h"
#include "tests/server/store/followed.h"
#include "tests/server/store/sample_entries.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

using testing::DiskFault;
using testing::FaultyVfs;

TEST(Journal, TellsOnlyWhatIsOnTheDisk) {
  const auto store = *OpenStore(std::string(kInMemory));
  Followed first, second;
  Journal journal(*store, {.commit_delay_ms = 5});
  journal.Start();
  journal.Open(SampleSession(1), first.durable());
  journal.Open(SampleSession(2), second.durable());
  for (std::uint64_t i = 1; i <= 300; ++i) {
    EXPECT_EQ(journal.Append(1, SampleScan(i)), i);
    EXPECT_TRUE(i % 3 != 0 || journal.Append(2, SampleOdometry(i)) == i / 3);
    if (i % 50 == 0) {
      const auto told = first.through.load();
      EXPECT_GE(static_cast<std::int64_t>(StoredEntries(*store, 1)), told);
    }
  }
  EXPECT_TRUE(test::Eventually([&] { return first.through == 300 && second.through == 100; }));
  EXPECT_EQ(StoredEntries(*store, 1), 300U);
  EXPECT_EQ(StoredEntries(*store, 2), 100U);
  EXPECT_FALSE(journal.health().degraded);
  EXPECT_EQ(journal.counts().entries, 400U);
  EXPECT_EQ(journal.Append(3, SampleOdometry(1)), 0U);  // No such session.
}

TEST(Journal, TheSessionGoesOnAfterTheLastPositionWhenItIsOpenedAgain) {
  const TempDirectory directory;
  for (std::uint64_t start = 0; start < 3; ++start) {
    const auto store = *OpenStore(directory.path());
    Journal journal(*store, {});
    journal.Start();
    if (start == 0) {
      journal.Open(SampleSession(1), {});
    } else {
      journal.Reopen(1, StoredEntries(*store, 1), {});
    }
    for (std::uint64_t i = 1; i <= 10; ++i) EXPECT_EQ(journal.Append(1, SampleScan(i)), 10 * start + i);
    journal.Stop();
    EXPECT_EQ(StoredEntries(*store, 1), 10 * (start + 1));
  }
}

TEST(Journal, AHoleInAJournalIsFound) {
  const auto store = *OpenStore(std::string(kInMemory));
  for (const std::uint64_t first : {1, 4}) {
    ASSERT_TRUE(store->Commit(
        {.removed = {},
         .put = {{{RecordKind::kJournal, 1, first + 1}, BytesOf(first, {SampleScan(1), SampleScan(2)})}}}));
  }
  std::uint64_t visited = 0;
  const auto read = ReadJournal(*store, 1, 0, [&](std::uint64_t, JournalEntry&&) -> Result<void> {
    ++visited;
    return {};
  });
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, StatusCode::kDataLoss);
  EXPECT_NE(read.error().message.find("misses entries 3 to 3"), std::string::npos) << read.error().message;
  EXPECT_EQ(visited, 2U);
}

TEST(Journal, WhileTheDiskFailsItIsDegradedAndGoesOnWhenTheDiskDoes) {
  for (const DiskFault fault : {DiskFault::kFull, DiskFault::kSyncError, DiskFault::kReadOnly}) {
    const TempDirectory directory;
    FaultyVfs vfs;
    const auto store = *OpenStore(directory.path(), FaultyVfs::name());
    Journal journal(*store, {.commit_delay_ms = 1});
    journal.Start();
    Followed told;
    journal.Open(SampleSession(1), told.durable());
    journal.Append(1, SampleScan(1));
    ASSERT_TRUE(test::Eventually([&] { return told.through == 1; }));
    vfs.Set(fault);
    EXPECT_EQ(journal.Append(1, SampleScan(2)), 2U);
    ASSERT_TRUE(test::Eventually([&] { return journal.health().degraded; }));
    EXPECT_FALSE(journal.health().reason.empty());
    EXPECT_EQ(journal.Append(1, SampleScan(3)), 3U);  // Nobody waits for the disk.
    EXPECT_EQ(told.through, 1);
    vfs.Set(DiskFault::kNone);
    ASSERT_TRUE(test::Eventually([&] { return told.through == 3; }));
    EXPECT_FALSE(journal.health().degraded);
    EXPECT_EQ(StoredEntries(*store, 1), 3U);
  }
}

TEST(Journal, ASessionThatFindsTheQueueFullIsNotStoredFromThereOn) {
  const TempDirectory directory;
  FaultyVfs vfs;
  std::uint64_t accepted = 0;
  {
    const auto store = *OpenStore(directory.path(), FaultyVfs::name());
    Journal journal(*store, {.commit_delay_ms = 1, .queue_mib = 1});
    journal.Start();
    Followed told;
    journal.Open(SampleSession(1), told.durable());
    ASSERT_TRUE(test::Eventually([&] { return told.through == 0; }));
    vfs.Set(DiskFault::kFull);
    for (std::uint64_t i = 1; i < 3000; ++i) {
      const std::uint64_t position = journal.Append(1, SampleScan(i));
      if (position == 0) break;
      accepted = position;
    }
    ASSERT_LT(accepted, 2000U);
    ASSERT_GT(accepted, 500U);
    vfs.Set(DiskFault::kNone);
    ASSERT_TRUE(test::Eventually([&] { return told.through == static_cast<std::int64_t>(accepted); }));
    // There is room again, but the session has a hole.
    EXPECT_EQ(journal.Append(1, SampleScan(9000)), 0U);
    EXPECT_TRUE(journal.health().degraded);
    EXPECT_NE(journal.health().reason.find("no longer stored"), std::string::npos) << journal.health().reason;
  }
  EXPECT_EQ(StoredEntries(**OpenStore(directory.path()), 1), accepted);
}

std::string LargeState(std::uint64_t seed, std::size_t size) {
  std::string bytes(size, '\0');
  std::uint64_t x = seed;
  for (char& c : bytes) {
    x = x * 6364136223846793005ULL + 1442695040888963407ULL;
    c = static_cast<char>(x >> 56);
  }
  return bytes;
}

TEST(Journal, ACheckpointIsWholeOrTheOneBeforeIsTaken) {
  const TempDirectory directory;
  const auto store = *OpenStore(directory.path());
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Start();
  journal.Open(SampleSession(1), {});
  for (std::uint64_t i = 1; i <= 5; ++i) journal.Append(1, SampleScan(i));
  EXPECT_FALSE(*ReadCheckpoint(*store, 1));
  const auto checkpoint_at = [&](std::uint64_t position, std::size_t size) {
    ASSERT_TRUE(
        journal.Checkpoint(1, position, [position, size] { return CheckpointContent{LargeState(position, size)}; }));
    EXPECT_TRUE(test::Eventually([&] {
      const auto newest = ReadCheckpoint(*store, 1);
      return newest && *newest && (*newest)->position == position;
    }));
    EXPECT_EQ((*ReadCheckpoint(*store, 1))->bytes, LargeState(position, size));
  };
  checkpoint_at(2, 9'500'000);
  ASSERT_TRUE(
      test::Eventually([&] { return journal.Checkpoint(1, 4, [] { return CheckpointContent{LargeState(4, 100)}; }); }));
  ASSERT_TRUE(test::Eventually([&] { return (*ReadCheckpoint(*store, 1))->position == 4; }));
  // A crash in the middle of a third one leaves parts of it.
  CheckpointWriter torn(1, 5, {LargeState(5, 9'000'000)});
  RecordChanges changes;
  torn.AddTo(changes);
  ASSERT_FALSE(torn.complete());
  ASSERT_TRUE(store->Commit(changes));
  EXPECT_EQ((*ReadCheckpoint(*store, 1))->position, 4U);
  EXPECT_EQ((*ReadCheckpoint(*store, 1))->bytes, LargeState(4, 100));
  journal.Stop();
  // What comes after a checkpoint is read from there on.
  std::vector<std::uint64_t> after;
  ASSERT_TRUE(ReadJournal(*store, 1, 4, [&](std::uint64_t position, JournalEntry&&) -> Result<void> {
    after.push_back(position);
    return {};
  }));
  EXPECT_EQ(after, std::vector<std::uint64_t>{5});
  EXPECT_EQ(*PositionOfCheckpoint(*store, 1), 4U);
  EXPECT_EQ(*EntriesAfterCheckpoint(*store, 1), 1U);
  EXPECT_EQ(*EntriesAfterCheckpoint(*store, 2), 0U) << "no such session";
}

// A server that is killed again and again may have the time for one between two kills.
TEST(Journal, TheCheckpointOfTheLongestJournalIsWrittenFirst) {
  const auto store = *OpenStore(std::string(kInMemory));
  Journal journal(*store, {});
  Mutex mutex;
  std::vector<std::uint64_t> written;
  const std::uint64_t lengths[] = {2, 5, 3};
  for (std::uint64_t session = 1; session <= 3; ++session) {
    journal.Open(SampleSession(session), {});
    const std::uint64_t length = lengths[session - 1];
    for (std::uint64_t i = 1; i <= length; ++i) journal.Append(session, SampleOdometry(i));
    const auto content = [&, session] {
      const MutexLock lock(mutex);
      written.push_back(session);
      return CheckpointContent{"state"};
    };
    // Of where it was wanted, not of how much that one leaves out: what waits for long becomes more urgent.
    ASSERT_TRUE(journal.Checkpoint(session, 1, content));
  }
  journal.Start();
  EXPECT_TRUE(test::Eventually([&] {
    const MutexLock lock(mutex);
    return written == std::vector<std::uint64_t>{2, 3, 1};
  }));
}

// The oldest history goes first, and never what a checkpoint needs: all of it where there is none.
TEST(Journal, OverTheBudgetOnlyTheJournalBeforeACheckpointIsRemoved) {
  const TempDirectory directory;
  const auto store = *OpenStore(directory.path());
  Journal journal(*store, {.commit_delay_ms = 1, .max_gib = 1e-6});
  journal.Start();
  Followed told[3];
  for (const std::uint64_t session : {1, 2}) {
    journal.Open(SampleSession(session), told[session].durable());
    // In two commits at least: an entry is removed with the commit that it belongs to.
    for (const std::int64_t through : {200, 300}) {
      while (journal.position(session) < static_cast<std::uint64_t>(through)) journal.Append(session, SampleScan(7));
      ASSERT_TRUE(test::Eventually([&] { return told[session].through == through; }));
    }
  }
  ASSERT_TRUE(journal.Checkpoint(1, 200, [] { return CheckpointContent{LargeState(1, 1000)}; }));
  std::uint64_t first = 0;
  ASSERT_TRUE(test::Eventually([&] {
    first = 0;
    const auto see = [&first](std::uint64_t position, JournalEntry&&) -> Result<void> {
      first = first == 0 ? position : first;
      return {};
    };
    static_cast<void>(ReadJournal(*store, 1, 200, see));
    return !ReadJournal(*store, 1, 0, see);  // Its beginning is gone.
  }));
  EXPECT_EQ(first, 201U);
  EXPECT_EQ(*ReadJournal(*store, 1, 200, [](std::uint64_t, JournalEntry&&) -> Result<void> { return {}; }), 300U);
  EXPECT_EQ((*ReadCheckpoint(*store, 1))->bytes, LargeState(1, 1000));
  EXPECT_EQ(StoredEntries(*store, 2), 300U);  // Without a checkpoint everything is needed.
  EXPECT_TRUE(test::Eventually([&] { return journal.health().over_budget; }));
  EXPECT_FALSE(journal.health().degraded);
}

// A journal is of use as a whole only, so it is removed as a whole: that of the session that was begun first.
TEST(Journal, OverTheBudgetTheOldestSessionGivesItsJournalFirst) {
  const TempDirectory directory;
  const auto store = *OpenStore(directory.path());
  constexpr std::uint64_t kEntries = 300;
  std::uint64_t before = 0;  // Bytes, without the last session.
  {
    Journal journal(*store, {.commit_delay_ms = 1});
    journal.Start();
    for (const std::uint64_t session : {1, 2, 3}) {
      before = *store->bytes_used();
      Followed told;
      journal.Open(SampleSession(session), told.durable());
      while (journal.position(session) < kEntries) {
        // In many commits, so that it takes some pages.
        const auto through = static_cast<std::int64_t>(journal.Append(session, SampleScan(journal.position(session))));
        if (through % 10 != 0) continue;
        ASSERT_TRUE(test::Eventually([&] { return told.through == through; }));
      }
      ASSERT_TRUE(test::Eventually([&] { return told.through == static_cast<std::int64_t>(kEntries); }));
      ASSERT_TRUE(journal.Checkpoint(session, kEntries, [] { return CheckpointContent{LargeState(1, 100)}; }));
      ASSERT_TRUE(test::Eventually([&] { return ReadCheckpoint(*store, session)->has_value(); }));
      journal.Close(session);
    }
    journal.Stop();
  }
  const std::uint64_t used = *store->bytes_used();
  // What the journal of one session has is enough.
  ASSERT_GT(used, before + 4 * 4096);
  const double limit = static_cast<double>(used) - 0.25 * static_cast<double>(used - before);
  Journal journal(*store, {.commit_delay_ms = 1, .max_gib = limit / (1 << 30)});
  for (const std::uint64_t session : {3, 2, 1}) journal.Reopen(session, kEntries, {}, kEntries);
  journal.Start();
  journal.Append(3, SampleScan(8));
  ASSERT_TRUE(test::Eventually([&] {
    const auto numbers = store->Numbers({.kind = RecordKind::kJournal, .owner = 1});
    return numbers && numbers->empty();
  }));
  journal.Stop();
  EXPECT_EQ(StoredEntries(*store, 2), kEntries);
  EXPECT_EQ(StoredEntries(*store, 3), kEntries + 1);
  EXPECT_TRUE(ReadCheckpoint(*store, 1)->has_value());
  EXPECT_FALSE(journal.health().over_budget);
}

TEST(Journal, BelowTheBudgetEverythingIsKept) {
  const TempDirectory directory;
  const auto store = *OpenStore(directory.path());
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Start();
  journal.Open(SampleSession(1), {});
  for (std::uint64_t i = 1; i <= 50; ++i) journal.Append(1, SampleScan(i));
  ASSERT_TRUE(journal.Checkpoint(1, 40, [] { return CheckpointContent{LargeState(1, 1000)}; }));
  ASSERT_TRUE(test::Eventually(
      [&] { return journal.Checkpoint(1, 50, [] { return CheckpointContent{LargeState(2, 1000)}; }); }));
  journal.Stop();
  EXPECT_EQ(StoredEntries(*store, 1), 50U);
}

TEST(Journal, WhatIsForgottenIsGone) {
  const auto store = *OpenStore(std::string(kInMemory));
  Journal journal(*store, {.commit_delay_ms = 10000});
  journal.Start();
  journal.Open(SampleSession(1), {});
  journal.Append(1, SampleScan(1));
  journal.Forget(1);
  journal.Put({RecordKind::kSite, 4, 0}, [] { return std::string("new"); });
  journal.Remove({.kind = RecordKind::kSite, .owner = 4});
  journal.Put({RecordKind::kSite, 5, 0}, [] { return std::string("new"); });
  journal.Stop();
  EXPECT_TRUE(store->Owners(RecordKind::kSession)->empty());
  EXPECT_TRUE(store->Owners(RecordKind::kJournal)->empty());
  EXPECT_EQ(*store->Owners(RecordKind::kSite), std::vector<std::uint64_t>{5});
}

TEST(Journal, WorkBetweenTwoCommitsSeesEverythingBeforeAndNothingElseIsWrittenMeanwhile) {
  const auto store = *OpenStore(std::string(kInMemory));
  Journal journal(*store, {.commit_delay_ms = 10000});
  journal.Start();
  journal.Open(SampleSession(1), {});
  for (std::uint64_t i = 1; i <= 20; ++i) journal.Append(1, SampleScan(i));
  std::atomic<std::uint64_t> seen{0}, later{0};
  std::atomic<bool> done{false};
  journal.Between([&](Store& of) {
    seen = StoredEntries(of, 1);
    for (std::uint64_t i = 21; i <= 25; ++i) journal.Append(1, SampleScan(i));
    journal.Put({RecordKind::kSite, 5, 0}, [] { return std::string("new"); });
    later = StoredEntries(of, 1) + of.Owners(RecordKind::kSite)->size();
    done = true;
  });
  ASSERT_TRUE(test::Eventually([&] { return done.load(); }));
  EXPECT_EQ(seen, 20U);
  EXPECT_EQ(later, 20U);
  journal.Stop();
  EXPECT_EQ(StoredEntries(*store, 1), 25U);
}

// Saving a large site took so long that the queue overflowed, and sessions were no longer stored.
TEST(Journal, AWorkCanEndBeforeTheQueueOverflows) {
  const auto store = *OpenStore(std::string(kInMemory));
  Journal journal(*store, {.commit_delay_ms = 1, .queue_mib = 1});
  journal.Start();
  journal.Open(SampleSession(1), {});
  std::atomic<std::uint64_t> appended{0};
  std::atomic<bool> done{false};
  journal.Between([&](Store&) {
    while (journal.HasTimeToSpare() && appended < 1'000'000) journal.Append(1, SampleScan(++appended));
    done = true;
  });
  ASSERT_TRUE(test::Eventually([&] { return done.load(); }));
  EXPECT_GT(appended, 10U);
  EXPECT_LT(appended, 1'000'000U);
  EXPECT_FALSE(journal.IsLost(1));
  journal.Stop();
  EXPECT_EQ(StoredEntries(*store, 1), appended);
}

// Its parts would be found by a later session of the same number.
TEST(Journal, ACheckpointOfASessionThatIsClosedMeanwhileIsNotFinished) {
  const auto store = *OpenStore(std::string(kInMemory));
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Start();
  journal.Open(SampleSession(1), {});
  journal.Append(1, SampleScan(1));
  std::atomic<bool> begun{false}, closed{false}, removed{false};
  ASSERT_TRUE(journal.Checkpoint(1, 1, [&] {
    begun = true;
    EXPECT_TRUE(test::Eventually([&] { return closed.load(); }));
    return CheckpointContent{LargeState(1, 20'000'000)};
  }));
  ASSERT_TRUE(test::Eventually([&] { return begun.load(); }));
  journal.Close(1);
  EXPECT_EQ(journal.Append(1, SampleScan(2)), 0U);
  journal.Between([&](Store& of) {
    EXPECT_TRUE(of.Commit({.removed = {{.kind = RecordKind::kCheckpoint, .owner = 1}}, .put = {}}));
    removed = true;
  });
  closed = true;
  ASSERT_TRUE(test::Eventually([&] { return removed.load(); }));
  journal.Put({RecordKind::kSite, 5, 0}, [] { return std::string("new"); });
  ASSERT_TRUE(test::Eventually([&] { return store->Owners(RecordKind::kSite)->size() == 1; }));
  journal.Stop();
  EXPECT_TRUE(store->Owners(RecordKind::kCheckpoint)->empty());
  EXPECT_EQ(StoredEntries(*store, 1), 1U) << "what was stored stays";
}

}  // namespace
}  // namespace cairn::server::testing
