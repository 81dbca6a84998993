// A journal whose disk is full or fails at the worst moment, or whose memory is short.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <new>

#include "server/store/checkpoint_writer.h"
#include "server/store/journal.h"
#include "server/store/sqlite_store.h"
#include "tests/eventually.h"
#include "tests/server/store/followed.h"
#include "tests/server/store/passing_store.h"
#include "tests/server/store/sample_entries.h"
#include "tests/server/store/stored_sites.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr std::size_t kQueueBytes = std::size_t{1} << 20;
const StoreOptions kSmallQueue{.commit_delay_ms = 1, .queue_mib = 1};

// Nothing can be written any more after the commit in which a checkpoint becomes complete.
class FullAfterACheckpoint : public PassingStore {
 public:
  using PassingStore::PassingStore;
  Result<void> Commit(const RecordChanges& changes) override {
    if (full_) return Fail(StatusCode::kResourceExhausted, "the disk is full");
    auto committed = store().Commit(changes);
    full_ = ReadCheckpoint(store(), 1).value().has_value();
    return committed;
  }

 private:
  std::atomic<bool> full_{false};
};

std::uint64_t LastEntry(Store& store, std::uint64_t session) {
  const auto last = ReadJournal(store, session, 0, [](auto, JournalEntry&&) { return Result<void>{}; });
  EXPECT_TRUE(last) << last.error().message;
  return last.value_or(0);
}

bool HasSession(Store& store, std::uint64_t session) {
  return ReadSessions(store)->contains(session);
}

// A job's record as large as this is waiting.
void FillQueue(Journal& journal, std::size_t bytes) {
  journal.Put(
      {RecordKind::kJob, 99, 0}, [] { return std::string("x"); }, bytes);
}

TEST(JournalFaults, ACheckpointIsNeverAheadOfTheEntriesBeforeIt) {
  const auto memory = MemoryStore();
  FullAfterACheckpoint store(*memory);
  {
    Journal journal(store, {.commit_delay_ms = 1});
    journal.Open(SampleSession(1), {});
    for (std::uint64_t i = 1; i <= 3; ++i) journal.Append(1, SampleOdometry(i));
    // This record's bytes are made while its group is prepared. An entry and a checkpoint that come then belong to the
    // next group.
    journal.Put({RecordKind::kJob, 1, 0}, [&] {
      const std::uint64_t position = journal.Append(1, SampleOdometry(4));
      EXPECT_TRUE(journal.Checkpoint(1, position, [] { return CheckpointContent{"state after 4"}; }));
      return std::string("x");
    });
    journal.Start();
    EXPECT_TRUE(test::Eventually([&] { return ReadCheckpoint(*memory, 1).value().has_value(); }));
  }
  EXPECT_EQ((*ReadCheckpoint(*memory, 1))->position, 4U);
  EXPECT_EQ(LastEntry(*memory, 1), 4U);
}

TEST(JournalFaults, OneCheckpointThatCannotBeMadeIsLeftOutAndTheJournalGoesOn) {
  const auto store = MemoryStore();
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Start();
  journal.Open(SampleSession(1), {});
  journal.Append(1, SampleOdometry(1));
  ASSERT_TRUE(journal.Checkpoint(1, 1, []() -> CheckpointContent { throw std::bad_alloc(); }));
  EXPECT_TRUE(test::Eventually([&] { return journal.health().degraded; }));
  EXPECT_EQ(journal.Append(1, SampleOdometry(2)), 2U);
  EXPECT_TRUE(test::Eventually([&] { return LastEntry(*store, 1) == 2U; }));
  EXPECT_TRUE(test::Eventually([&] { return journal.Checkpoint(1, 2, [] { return CheckpointContent{"two"}; }); }));
  EXPECT_TRUE(test::Eventually([&] { return !journal.health().degraded; }));
  EXPECT_EQ((*ReadCheckpoint(*store, 1))->bytes, "two");
}

// To write it again would begin with removing the one that is there.
TEST(JournalFaults, ACheckpointAtThePositionOfTheNewestIsRefused) {
  const auto store = MemoryStore();
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Reopen(1, 7, {}, 5);
  EXPECT_FALSE(journal.Checkpoint(1, 5, [] { return CheckpointContent{"again"}; }));
  EXPECT_TRUE(journal.Checkpoint(1, 6, [] { return CheckpointContent{"later"}; }));
}

TEST(JournalFaults, WhereTheQueueIsFullALayerIsStoredAllTheSameBeforeItsSessionIsForgotten) {
  for (const std::size_t room : {100, 600}) {
    const auto store = MemoryStore();
    Put(*store, SampleSite{});
    Journal journal(*store, kSmallQueue);
    FillQueue(journal, kQueueBytes - room);
    journal.Put({RecordKind::kLayer, HashName("lab"), 1}, [] { return BytesOf(StoredLayer{1, SampleGrid(1)}); });
    journal.Forget(1);
    journal.Start();
    journal.Stop();
    EXPECT_FALSE(HasSession(*store, 1));
    EXPECT_FALSE(*ReadCheckpoint(*store, 1));
    const std::vector<StoredLayer> layers = *ReadLayers(*store, HashName("lab"));
    EXPECT_TRUE(std::ranges::any_of(layers, [](const StoredLayer& layer) { return layer.session == 1; }));
  }
}

TEST(JournalFaults, ASessionIsForgottenAsAWholeOrNotAtAll) {
  for (const std::size_t room : {10, 300}) {
    const auto store = MemoryStore();
    Put(*store, SampleSite{});
    Journal journal(*store, kSmallQueue);
    FillQueue(journal, 2 * kQueueBytes - room);
    journal.Forget(1);
    journal.Start();
    journal.Stop();
    EXPECT_EQ(HasSession(*store, 1), room == 10);
    EXPECT_EQ(ReadCheckpoint(*store, 1)->has_value(), room == 10);
    EXPECT_EQ(LastEntry(*store, 1) > 0, room == 10);
  }
}

TEST(JournalFaults, ANewSessionTakesNothingOverFromAnotherOfItsNumber) {
  const auto store = MemoryStore();
  Put(*store, SampleSite{});
  ASSERT_TRUE(store->Commit({.removed = {{.kind = RecordKind::kSession, .owner = 1}}, .put = {}}));
  ASSERT_TRUE(*ReadCheckpoint(*store, 1));
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Start();
  journal.Open(SampleSession(1), {});
  journal.Append(1, SampleOdometry(1));
  journal.Stop();
  EXPECT_TRUE(HasSession(*store, 1));
  EXPECT_FALSE(*ReadCheckpoint(*store, 1));
  EXPECT_EQ(LastEntry(*store, 1), 1U);
}

// A session with a journal of 24 MB, in a file.
std::unique_ptr<Store> StoreWithALongJournal(const std::filesystem::path& directory, std::uint64_t session) {
  auto store = *OpenStore(directory);
  Put(*store, SampleSite{});
  for (std::uint64_t last = 1; last <= 3000; ++last) {
    const std::string bytes = BytesOf(last, std::vector<JournalEntry>{SampleOdometry(last)}) + std::string(8000, 'x');
    EXPECT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kJournal, session, last}, bytes}}}));
  }
  store.reset();  // The log goes into the file.
  return *OpenStore(directory);
}

// The disk does not answer, where it is asked to, until it is let go.
class HangingStore : public PassingStore {
 public:
  using PassingStore::PassingStore;
  Result<void> Commit(const RecordChanges& changes) override {
    commits_hang_.wait(true);
    return store().Commit(changes);
  }
  Result<std::size_t> RemoveFirst(const RecordRange& range, std::size_t count) override {
    removals_hang_.wait(true);
    return store().RemoveFirst(range, count);
  }
  void Hang(bool commits, bool removals) {
    commits_hang_ = commits;
    removals_hang_ = removals;
    commits_hang_.notify_all();
    removals_hang_.notify_all();
  }

 private:
  std::atomic<bool> commits_hang_{false}, removals_hang_{false};
};

// Nothing was said of it, although nothing was durable any more.
TEST(JournalFaults, ADiskThatDoesNotAnswerIsSaid) {
  for (const bool removals : {false, true}) {
    const auto memory = *OpenStore(std::string(kInMemory));
    HangingStore store(*memory);
    Followed told;
    Journal journal(store, {.commit_delay_ms = 1});
    journal.Open(SampleSession(1), told.durable());
    journal.Start();
    ASSERT_TRUE(test::Eventually([&] { return told.through == 0; }));
    store.Hang(!removals, removals);
    if (removals) journal.Forget(2);
    journal.Append(1, SampleOdometry(1));
    EXPECT_FALSE(journal.health().degraded);
    EXPECT_TRUE(test::Eventually([&] { return journal.health().degraded; }, std::chrono::seconds(30)));
    EXPECT_THAT(journal.health().reason, ::testing::HasSubstr("the disk has not answered"));
    store.Hang(false, false);
    EXPECT_TRUE(test::Eventually([&] { return !journal.health().degraded && told.through == 1; }));
  }
}

// Counts how records are removed piece by piece.
class CountedRemovals : public PassingStore {
 public:
  using PassingStore::PassingStore;
  Result<std::size_t> RemoveFirst(const RecordRange& range, std::size_t count) override {
    auto removed = store().RemoveFirst(range, count);
    ++removals_;
    if (removed && *removed > largest_removal_) largest_removal_ = *removed;
    return removed;
  }
  [[nodiscard]] std::size_t removals() const { return removals_; }
  [[nodiscard]] std::size_t largest_removal() const { return largest_removal_; }

 private:
  std::atomic<std::size_t> removals_{0}, largest_removal_{0};
};

// One removal of all of it would take long, with nothing else written meanwhile, and much room on the disk.
TEST(JournalFaults, ALongJournalIsRemovedPieceByPieceWithHardlyAnyRoom) {
  const TempDirectory directory;
  const auto file = StoreWithALongJournal(directory.path(), 1);
  const auto store = std::make_unique<CountedRemovals>(*file);
  Followed told;
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Open(SampleSession(77), told.durable());
  journal.Forget(1);
  journal.Start();
  std::size_t longest = 0;
  ASSERT_TRUE(test::Eventually([&] {
    longest = std::max<std::size_t>(longest, std::filesystem::file_size(directory.path() / "cairn.db-wal"));
    journal.Append(77, SampleOdometry(1));
    return store->Numbers({.kind = RecordKind::kJournal, .owner = 1})->empty();
  }));
  EXPECT_LT(longest, 4U << 20);
  EXPECT_FALSE(HasSession(*store, 1));
  EXPECT_EQ(store->largest_removal(), RemovedAtOnce(RecordKind::kJournal));
  EXPECT_GE(store->removals(), 3000 / RemovedAtOnce(RecordKind::kJournal));
}

// A process that ends before all is removed leaves the rest to the next one, which does not give the number again.
TEST(JournalFaults, WhatIsLeftOfASessionThatIsGoneIsRemovedAfterTheNextStart) {
  const TempDirectory directory;
  const auto store = StoreWithALongJournal(directory.path(), 500);
  ASSERT_TRUE(store->Commit({.removed = {}, .put = {MarkOfRemoved(500)}}));
  EXPECT_EQ(*LastSession(*store), 500U);
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Start();
  journal.Open(SampleSession(501), {});
  ASSERT_TRUE(test::Eventually([&] { return store->Numbers({.kind = RecordKind::kJournal, .owner = 500})->empty(); }));
  EXPECT_TRUE(HasSession(*store, 501));
  EXPECT_GT(LastEntry(*store, 1), 0U) << "of a session that is there";
  EXPECT_TRUE(test::Eventually([&] { return store->Owners(RecordKind::kRemoved)->empty(); }));
}

// It ended with the first exception, while new sessions were said to be stored.
TEST(JournalFaults, AfterAnExceptionTheJournalGoesOnAndItsSessionsAreStoredAgain) {
  const auto store = MemoryStore();
  Followed told, later;
  Journal journal(*store, {.commit_delay_ms = 1});
  journal.Start();
  journal.Open(SampleSession(1), told.durable());
  ASSERT_TRUE(test::Eventually([&] { return told.through == 0; }));
  journal.Put({RecordKind::kJob, 99, 0}, []() -> std::string { throw std::bad_alloc(); });
  ASSERT_TRUE(test::Eventually([&] { return journal.IsLost(1); }));
  EXPECT_TRUE(journal.health().degraded);
  EXPECT_EQ(journal.Append(1, SampleOdometry(1)), 0U);
  journal.Open(SampleSession(2), later.durable());
  EXPECT_EQ(journal.Append(2, SampleOdometry(1)), 1U);
  EXPECT_TRUE(test::Eventually([&] { return later.through == 1; }));
  const std::uint64_t position = journal.Recover(1);
  ASSERT_GT(position, 0U);
  std::atomic<bool> done = false;
  ASSERT_TRUE(journal.Checkpoint(
      1, position, [] { return CheckpointContent{"all"}; }, [&](bool stored) { done = stored; }));
  EXPECT_TRUE(test::Eventually([&] { return done.load(); }));
  EXPECT_FALSE(journal.IsLost(1));
}

// Longer records do not fit.
class SmallRecords : public PassingStore {
 public:
  using PassingStore::PassingStore;
  Result<void> Commit(const RecordChanges& changes) override {
    for (const Record& record : changes.put)
      if (record.bytes.size() > max_record_bytes()) return Fail(StatusCode::kOutOfRange, "too long");
    return store().Commit(changes);
  }
  std::size_t max_record_bytes() const override { return 20'000; }
};

// The group with it was tried again for ever, and everything behind it waited.
TEST(JournalFaults, ARecordThatIsTooLongForTheStoreKeepsNothingElseFromBeingWritten) {
  const auto memory = MemoryStore();
  SmallRecords store(*memory);
  std::atomic<int> told{0};
  Journal journal(store, {.commit_delay_ms = 1});
  for (const std::uint64_t session : {1, 2})
    journal.Open(SampleSession(session),
                 [&told](const std::vector<JournalEntry>& entries) { told += static_cast<int>(entries.size()); });
  EXPECT_EQ(journal.Append(1, SampleScan(1)), 1U);
  EXPECT_EQ(journal.Append(2, SampleScan(1, 10'000)), 1U);
  journal.Put({RecordKind::kJob, 3, 0}, [] { return std::string(30'000, 'x'); });
  journal.Put({RecordKind::kJob, 4, 0}, [] { return std::string("x"); });
  journal.Start();
  ASSERT_TRUE(test::Eventually([&] { return told == 1; }));
  EXPECT_EQ(LastEntry(*memory, 1), 1U);
  EXPECT_EQ(LastEntry(*memory, 2), 0U);
  EXPECT_EQ(*memory->Owners(RecordKind::kJob), std::vector<std::uint64_t>{4});
  EXPECT_TRUE(journal.health().degraded);
  EXPECT_NE(journal.health().reason.find("too long"), std::string::npos) << journal.health().reason;
  EXPECT_EQ(journal.Append(2, SampleScan(2)), 0U) << "its journal would have a gap";
  EXPECT_EQ(journal.Append(1, SampleScan(2)), 2U);
}

// The scans go on to be stored.
TEST(JournalFaults, ACheckpointThatIsTooLargeIsLeftOutWithTheReasonAndTheJournalStays) {
  const auto memory = MemoryStore();
  Journal journal(*memory, {.commit_delay_ms = 1});
  journal.Open(SampleSession(1), [](const auto&) {});
  journal.Start();
  EXPECT_EQ(journal.Append(1, SampleScan(1)), 1U);
  ASSERT_TRUE(journal.Checkpoint(1, 1, [] {
    CheckpointContent content{"main"};
    content.pieces.push_back({std::make_shared<const int>(1), []() -> std::string {
                                throw std::length_error("a piece of the checkpoint has too many bytes");
                              }});
    return content;
  }));
  ASSERT_TRUE(test::Eventually([&] { return journal.health().degraded; }));
  EXPECT_NE(journal.health().reason.find("too many bytes"), std::string::npos) << journal.health().reason;
  EXPECT_EQ(journal.Append(1, SampleScan(2)), 2U);
  EXPECT_TRUE(test::Eventually([&] { return LastEntry(*memory, 1) == 2; }));
  EXPECT_FALSE(*ReadCheckpoint(*memory, 1));
}

}  // namespace
}  // namespace cairn::server::testing
