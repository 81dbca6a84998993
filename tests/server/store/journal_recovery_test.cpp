// A session that was not stored for a while is stored again (Journal::Recover).
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <vector>

#include "server/store/checkpoint_writer.h"
#include "server/store/journal.h"
#include "server/store/sqlite_store.h"
#include "tests/eventually.h"
#include "tests/server/store/faulty_vfs.h"
#include "tests/server/store/followed.h"
#include "tests/server/store/sample_entries.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

// A session that found the queue full stayed unstored until the server was started again.
TEST(JournalRecovery, ASessionIsStoredAgainWithACheckpointOfItsPresentState) {
  const TempDirectory directory;
  FaultyVfs vfs;
  std::uint64_t position = 0;
  {
    const auto store = *OpenStore(directory.path(), FaultyVfs::name());
    Followed told;
    std::atomic<bool> done = false;
    Journal journal(*store, {.commit_delay_ms = 1, .queue_mib = 1});
    journal.Start();
    journal.Open(SampleSession(1), told.durable());
    ASSERT_TRUE(test::Eventually([&] { return told.through == 0; }));
    EXPECT_EQ(journal.Recover(1), 0U) << "it is stored";
    vfs.Set(DiskFault::kFull);
    std::uint64_t accepted = 0;
    while (const std::uint64_t next = journal.Append(1, SampleScan(accepted + 1))) accepted = next;
    EXPECT_EQ(journal.Recover(1), 0U) << "the disk still fails";
    vfs.Set(DiskFault::kNone);
    ASSERT_TRUE(test::Eventually([&] { return told.through == static_cast<std::int64_t>(accepted); }));
    position = journal.Recover(1);
    ASSERT_EQ(position, accepted + 1);
    EXPECT_EQ(journal.position(1), position);
    EXPECT_EQ(journal.Append(1, SampleScan(7001)), position + 1);
    EXPECT_TRUE(journal.health().degraded) << "the state is not on the disk yet";
    ASSERT_TRUE(journal.Checkpoint(
        1, position, [] { return CheckpointContent{"all before"}; }, [&](bool stored) { done = stored; }));
    ASSERT_TRUE(test::Eventually([&] { return done.load(); }));
    ASSERT_TRUE(test::Eventually([&] { return told.through == static_cast<std::int64_t>(accepted) + 1; }));
    EXPECT_FALSE(journal.health().degraded) << journal.health().reason;
    EXPECT_EQ(journal.Append(1, SampleScan(7002)), position + 2);
  }
  const auto store = *OpenStore(directory.path());
  const auto checkpoint = ReadCheckpoint(*store, 1);
  ASSERT_TRUE(checkpoint && *checkpoint);
  EXPECT_EQ((*checkpoint)->position, position);
  EXPECT_EQ((*checkpoint)->bytes, "all before");
  std::vector<std::uint64_t> entries;
  const auto last = ReadJournal(*store, 1, position, [&entries](std::uint64_t at, JournalEntry&&) -> Result<void> {
    entries.push_back(at);
    return {};
  });
  ASSERT_TRUE(last) << last.error().message;
  EXPECT_EQ(entries, (std::vector{position + 1, position + 2}));
}

// A server that ends before the checkpoint is complete leaves what there was before, without a gap.
TEST(JournalRecovery, WhatFollowsACheckpointThatIsNotThereYetIsNotWritten) {
  const TempDirectory directory;
  FaultyVfs vfs;
  std::uint64_t accepted = 0;
  {
    const auto store = *OpenStore(directory.path(), FaultyVfs::name());
    Followed told;
    Journal journal(*store, {.commit_delay_ms = 1, .queue_mib = 1});
    journal.Start();
    journal.Open(SampleSession(1), told.durable());
    vfs.Set(DiskFault::kFull);
    while (const std::uint64_t next = journal.Append(1, SampleScan(accepted + 1))) accepted = next;
    vfs.Set(DiskFault::kNone);
    ASSERT_TRUE(test::Eventually([&] { return told.through == static_cast<std::int64_t>(accepted); }));
    ASSERT_NE(journal.Recover(1), 0U);
    EXPECT_NE(journal.Append(1, SampleScan(7001)), 0U);
    journal.Abandon(1);
    EXPECT_EQ(journal.Append(1, SampleScan(7002)), 0U);
    EXPECT_NE(journal.Recover(1), 0U) << "it may be tried again";
    EXPECT_NE(journal.Append(1, SampleScan(7003)), 0U);
  }
  EXPECT_EQ(StoredEntries(**OpenStore(directory.path()), 1), accepted);
}

// With neither checkpoint nor journal it would begin, at the next start, where its robot once stood.
TEST(JournalRecovery, ASessionThatWasNotEvenOpenedOnTheDiskGetsThereTogetherWithItsCheckpoint) {
  const auto store = *OpenStore(std::string(kInMemory));
  Journal journal(*store, {.commit_delay_ms = 1, .queue_mib = 1});
  journal.Put(
      {RecordKind::kJob, 99, 0}, [] { return std::string("x"); }, std::size_t{1} << 20);
  journal.Open(SampleSession(1), {});
  EXPECT_EQ(journal.Append(1, SampleScan(1)), 0U);
  journal.Start();
  std::uint64_t position = 0;
  ASSERT_TRUE(test::Eventually([&] { return (position = journal.Recover(1)) != 0; }));
  EXPECT_NE(journal.Append(1, SampleScan(2)), 0U);
  EXPECT_TRUE(store->Owners(RecordKind::kSession)->empty());
  ASSERT_TRUE(journal.Checkpoint(1, position, [] { return CheckpointContent{"state"}; }));
  ASSERT_TRUE(test::Eventually([&] { return !journal.health().degraded; }));
  EXPECT_EQ(*store->Owners(RecordKind::kSession), std::vector<std::uint64_t>{1});
}

}  // namespace
}  // namespace cairn::server::testing
