#include "server/store/sqlite_store.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <fstream>

#include "server/store/envelope.h"
#include "server/store/journal.h"
#include "tests/server/store/faulty_vfs.h"
#include "tests/temp_directory.h"

namespace cairn::server {
namespace {

using testing::DiskFault;
using testing::FaultyVfs;

Record Numbered(std::uint64_t number) {
  return {{RecordKind::kJournal, 1, number}, std::string(300, 'x') + std::to_string(number)};
}

std::vector<std::uint64_t> NumbersIn(Store& store) {
  std::vector<std::uint64_t> numbers;
  EXPECT_TRUE(store.Read({.kind = RecordKind::kJournal, .owner = 1},
                         [&](std::uint64_t number, std::string_view bytes) -> Result<void> {
                           EXPECT_EQ(bytes, Numbered(number).bytes);
                           numbers.push_back(number);
                           return {};
                         }));
  return numbers;
}

std::unique_ptr<Store> MustOpen(const std::filesystem::path& directory, const std::string& vfs = {}) {
  auto store = OpenStore(directory, vfs);
  EXPECT_TRUE(store) << store.error().message;
  return std::move(*store);
}

TEST(SqliteStore, KeepsRecordsInTheOrderOfTheirNumbers) {
  const TempDirectory directory;
  const std::vector<std::uint64_t> numbers = {0, 3, 200, UINT64_MAX / 2, UINT64_MAX / 2 + 2, UINT64_MAX};
  {
    const auto store = MustOpen(directory / "state");
    for (auto number = numbers.rbegin(); number != numbers.rend(); ++number)
      ASSERT_TRUE(store->Commit({.removed = {}, .put = {Numbered(*number)}}));
    EXPECT_EQ(NumbersIn(*store), numbers);
  }
  const auto store = MustOpen(directory / "state");
  EXPECT_EQ(NumbersIn(*store), numbers);
  EXPECT_EQ(*store->Owners(RecordKind::kJournal), std::vector<std::uint64_t>{1});
  EXPECT_TRUE(store->Owners(RecordKind::kSite)->empty());
  ASSERT_TRUE(
      store->Commit({.removed = {{.kind = RecordKind::kJournal, .owner = 1, .first = 3, .last = 200}}, .put = {}}));
  EXPECT_EQ(NumbersIn(*store).size(), numbers.size() - 2);
}

TEST(SqliteStore, LivesInMemoryWhereAsked) {
  const auto store = MustOpen(std::string(kInMemory));
  ASSERT_TRUE(store->Commit({.removed = {}, .put = {Numbered(1)}}));
  EXPECT_EQ(NumbersIn(*store).size(), 1U);
  EXPECT_FALSE(std::filesystem::exists(":memory:"));
}

TEST(SqliteStore, ASecondServerOfADirectoryIsRefusedWithTheReason) {
  const TempDirectory directory;
  const auto first = MustOpen(directory.path());
  const auto second = OpenStore(directory.path());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, StatusCode::kAlreadyExists);
  EXPECT_NE(second.error().message.find(directory.path().string()), std::string::npos) << second.error().message;
}

TEST(SqliteStore, ForeignAndNewerFilesAreRefusedWithTheReason) {
  const TempDirectory directory;
  std::ofstream(directory / "cairn.db") << "this is not a database, and it is long enough to have a header of its own. "
                                           "More text, so that the header's hundred bytes are there.";
  const auto foreign = OpenStore(directory.path());
  ASSERT_FALSE(foreign);
  EXPECT_EQ(foreign.error().code, StatusCode::kDataLoss) << foreign.error().message;

  const auto execute = [](const std::filesystem::path& path, const char* sql) {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
    ASSERT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK);
    sqlite3_close(database);
  };
  std::filesystem::create_directory(directory / "other");
  execute(directory / "other" / "cairn.db", "CREATE TABLE music (title TEXT)");
  const auto other = OpenStore(directory / "other");
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().message.find("not a store"), std::string::npos) << other.error().message;

  MustOpen(directory / "newer").reset();
  execute(directory / "newer" / "cairn.db", "PRAGMA user_version = 99");
  const auto newer = OpenStore(directory / "newer");
  ASSERT_FALSE(newer);
  EXPECT_EQ(newer.error().code, StatusCode::kFailedPrecondition);
  EXPECT_NE(newer.error().message.find("newer"), std::string::npos) << newer.error().message;
}

TEST(SqliteStore, GenerationsGrowFromStartToStart) {
  const TempDirectory directory;
  EXPECT_EQ(*NextGeneration(*MustOpen(directory.path()), 1000), 1000U);
  // The clock was set back.
  EXPECT_EQ(*NextGeneration(*MustOpen(directory.path()), 10), 1001U);
  EXPECT_EQ(*NextGeneration(*MustOpen(directory.path()), 5000), 5000U);
}

TEST(SqliteStore, AFailingDiskIsAnErrorAndNothingOfTheCommitIsThereAfterIt) {
  for (const DiskFault fault :
       {DiskFault::kFull, DiskFault::kWriteError, DiskFault::kSyncError, DiskFault::kReadOnly}) {
    const TempDirectory directory;
    FaultyVfs vfs;
    {
      const auto store = MustOpen(directory.path(), FaultyVfs::name());
      ASSERT_TRUE(store->Commit({.removed = {}, .put = {Numbered(1)}}));
      vfs.Set(fault);
      RecordChanges many{.removed = {{.kind = RecordKind::kJournal, .owner = 1}}, .put = {}};
      for (std::uint64_t i = 2; i < 40; ++i) many.put.push_back(Numbered(i));
      const auto failed = store->Commit(many);
      ASSERT_FALSE(failed) << static_cast<int>(fault);
      EXPECT_EQ(failed.error().code,
                fault == DiskFault::kFull ? StatusCode::kResourceExhausted : StatusCode::kUnavailable);
      EXPECT_EQ(NumbersIn(*store), std::vector<std::uint64_t>{1});
      // The disk is repaired: the same commit succeeds.
      vfs.Set(DiskFault::kNone);
      ASSERT_TRUE(store->Commit(many));
      EXPECT_EQ(NumbersIn(*store).size(), 38U);
    }
    EXPECT_EQ(NumbersIn(*MustOpen(directory.path())).size(), 38U);
  }
}

}  // namespace
}  // namespace cairn::server
