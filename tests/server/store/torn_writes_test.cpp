// What a power failure or a bad disk leaves: files that end early or hold other bytes. The store then opens with
// everything up to some commit, or says what is wrong; it never gives out anything else.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/store/journal.h"
#include "server/store/sqlite_store.h"
#include "tests/server/store/sample_entries.h"
#include "tests/temp_directory.h"

namespace cairn::server {
namespace {

namespace fs = std::filesystem;

std::string BytesIn(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void WriteBytes(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

// The files of a server that was killed: commits 1..2 in the database, 3..kCommits in its write-ahead log. Commit i
// appends entries up to position 2 * i and sets record kSite 1/0 to i.
constexpr std::uint64_t kCommits = 4;

class KilledStore {
 public:
  KilledStore() : directory_(InMemory()) {
    {
      auto store = OpenStore(directory_ / "whole");
      for (std::uint64_t i = 1; i <= 2; ++i) Commit(**store, i);
    }
    auto store = OpenStore(directory_ / "whole");
    for (std::uint64_t i = 3; i <= kCommits; ++i) Commit(**store, i);
    database_ = BytesIn(directory_ / "whole" / "cairn.db");
    log_ = BytesIn(directory_ / "whole" / "cairn.db-wal");
  }

  [[nodiscard]] const std::string& database() const { return database_; }
  [[nodiscard]] const std::string& log() const { return log_; }

  // How many commits are there after a start on these files; nothing if it is refused.
  std::optional<std::uint64_t> CommitsIn(const std::string& database, const std::string& log) {
    const fs::path place = directory_ / "copy";
    fs::remove_all(place);
    fs::create_directory(place);
    WriteBytes(place / "cairn.db", database);
    WriteBytes(place / "cairn.db-wal", log);
    auto store = OpenStore(place);
    if (!store) {
      EXPECT_FALSE(store.error().message.empty());
      return std::nullopt;
    }
    std::optional<std::uint64_t> counter;
    const auto count = [&counter](std::uint64_t, std::string_view bytes) -> Result<void> {
      counter = std::stoull(std::string(bytes));
      return {};
    };
    if (!(*store)->Read({.kind = RecordKind::kSite, .owner = 1}, count)) return std::nullopt;
    const auto last = ReadJournal(**store, 1, 0, [](std::uint64_t position, JournalEntry&& entry) -> Result<void> {
      EXPECT_EQ(BytesOf(1, {entry}), BytesOf(1, {testing::SampleScan(position, 20)}));
      return {};
    });
    if (!last) return std::nullopt;
    // A changed byte may hide a record from the database. What is there is right, and there are no holes.
    tail_lost_ = *last < 2 * counter.value_or(0);
    EXPECT_LE(*last, 2 * counter.value_or(kCommits));
    return counter.value_or(0);
  }
  [[nodiscard]] bool tail_lost() const { return tail_lost_; }

 private:
  static void Commit(Store& store, std::uint64_t i) {
    const std::vector<JournalEntry> entries = {testing::SampleScan(2 * i - 1, 20), testing::SampleScan(2 * i, 20)};
    ASSERT_TRUE(store.Commit({.removed = {},
                              .put = {{{RecordKind::kSite, 1, 0}, std::to_string(i)},
                                      {{RecordKind::kJournal, 1, 2 * i}, BytesOf(2 * i - 1, entries)}}}));
  }

  // Thousands of starts that flush to a real disk would take minutes.
  static TempDirectory InMemory() {
    const fs::path memory = "/dev/shm";
    if (fs::is_directory(memory)) setenv("TMPDIR", memory.c_str(), 1);
    return {};
  }

  const TempDirectory directory_;
  std::string database_, log_;
  bool tail_lost_ = false;
};

TEST(TornWrites, ALogThatEndsAnywhereGivesEverythingUpToSomeCommit) {
  KilledStore killed;
  ASSERT_EQ(killed.CommitsIn(killed.database(), killed.log()), kCommits);
  ASSERT_GT(killed.log().size(), 8000U);
  std::uint64_t most = 2;
  for (std::size_t end = 0; end <= killed.log().size(); ++end) {
    const auto commits = killed.CommitsIn(killed.database(), killed.log().substr(0, end));
    ASSERT_TRUE(commits) << end;
    EXPECT_FALSE(killed.tail_lost()) << end;
    EXPECT_GE(*commits, most) << end;  // A longer log never holds less.
    most = *commits;
  }
  EXPECT_EQ(killed.CommitsIn(killed.database(), killed.log().substr(0, 0)), 2U);
}

TEST(TornWrites, ADatabaseThatEndsAnywhereIsRefusedOrGivesEverythingUpToSomeCommit) {
  KilledStore killed;
  for (std::size_t end = 0; end < killed.database().size(); end += end % 4096 < 32 ? 1 : 127) {
    for (const bool with_log : {false, true}) {
      const auto commits = killed.CommitsIn(killed.database().substr(0, end), with_log ? killed.log() : std::string());
      EXPECT_FALSE(commits && killed.tail_lost()) << end;
    }
  }
}

TEST(TornWrites, ChangedBytesAreNeverTakenForData) {
  KilledStore killed;
  int refused = 0;
  for (std::size_t at = 0; at < killed.database().size(); at += 13) {
    std::string changed = killed.database();
    changed[at] = static_cast<char>(changed[at] ^ 0x41);
    refused += killed.CommitsIn(changed, {}) ? 0 : 1;
  }
  EXPECT_GT(refused, 50);
  for (std::size_t at = 0; at < killed.log().size(); at += 13) {
    std::string changed = killed.log();
    changed[at] = static_cast<char>(changed[at] ^ 0x41);
    const auto commits = killed.CommitsIn(killed.database(), changed);
    ASSERT_TRUE(commits) << at;
    EXPECT_FALSE(killed.tail_lost()) << at;
  }
}

}  // namespace
}  // namespace cairn::server
