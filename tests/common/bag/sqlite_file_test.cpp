#include "common/bag/sqlite_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <iterator>
#include <string>
#include <vector>

#include "tests/common/bag/bag_writer.h"
#include "tests/temp_directory.h"

namespace cairn::bag {
namespace {

using recorded::WriteSqlite;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> Read(const std::filesystem::path& path, const std::vector<std::size_t>& wanted = {0}) {
  const auto file = OpenSqlite(path);
  if (!file) return {file.error().message};
  std::vector<std::string> messages;
  const auto read = (*file)->Read(wanted, [&](std::size_t topic, std::string_view message) {
    messages.push_back(std::to_string(topic) + std::string(message));
    return true;
  });
  if (!read) return {read.error().message};
  return messages;
}

void Execute(const std::filesystem::path& path, const std::string& sql) {
  SQLite::Database(path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE).exec(sql);
}

class SqliteFile : public ::testing::Test {
 protected:
  SqliteFile() {
    WriteSqlite(path_, {{"/a", "A", 5, "five"},
                        {"/b", "B", 4, "four"},
                        {"/a", "A", 1, "one"},
                        {"/c", "C", 2, "two"},
                        {"/a", "A", 5, "five too"}});
  }
  const TempDirectory directory_;
  const std::filesystem::path path_ = directory_ / "bag.db3";
};

TEST_F(SqliteFile, GivesMessagesInTheOrderOfTheirTimes) {
  EXPECT_THAT(Read(path_), ElementsAre("0one", "0five", "0five too"));
  EXPECT_THAT(Read(path_, {0, 1}), ElementsAre("0one", "1four", "0five", "0five too"));
  EXPECT_THAT((*OpenSqlite(path_))->topics()[2], (Topic{"/c", "C", "cdr"}));
  Execute(path_, "DROP INDEX timestamp_idx");
  EXPECT_THAT(Read(path_), ElementsAre("0one", "0five", "0five too")) << "without the index";
}

// As `ros2 bag record --storage-preset-profile resilient` makes them. Reading left files beside the bag, and failed
// where it could not.
TEST_F(SqliteFile, WithAnEndedLogIsReadWithoutAnotherFile) {
  std::filesystem::create_directory(directory_ / "100%?#");
  const std::filesystem::path path = directory_ / "100%?#/bag.db3";
  std::filesystem::copy_file(path_, path);
  const auto files = [&] {
    const std::filesystem::directory_iterator entries(path.parent_path());
    return std::distance(begin(entries), end(entries));
  };
  Execute(path, "PRAGMA journal_mode = WAL");
  ASSERT_EQ(files(), 1);
  EXPECT_THAT(Read(path), ElementsAre("0one", "0five", "0five too"));
  EXPECT_EQ(files(), 1);
  // While a recorder is at work, its log counts.
  SQLite::Database recorder(path.string(), SQLite::OPEN_READWRITE);
  recorder.exec("INSERT INTO messages (topic_id, timestamp, data) VALUES (7, 6, 'six')");
  ASSERT_GT(files(), 1);
  EXPECT_THAT(Read(path), ElementsAre("0one", "0five", "0five too", "0six"));
}

TEST_F(SqliteFile, RefusesWhatIsNoBag) {
  EXPECT_THAT(Read(directory_.Write("empty", "")), ElementsAre(HasSubstr("no such table")));
  EXPECT_THAT(Read(directory_.Write("text", std::string(2000, 'x'))), ElementsAre(HasSubstr("not a database")));
  EXPECT_THAT(Read(directory_ / "none"), ElementsAre(HasSubstr("none")));
}

// A table may be a question that never ends.
TEST_F(SqliteFile, AViewIsNoTable) {
  Execute(
      path_,
      "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE endless(id) AS (SELECT 1 UNION ALL SELECT id + 1 "
      "FROM endless) SELECT id, 7 AS topic_id, id AS timestamp, 'x' AS data FROM endless;");
  EXPECT_THAT(Read(path_), ElementsAre(HasSubstr("no such table")));
}

// Pages may be stored once and found many times: here by an index whose only page is that of a table with more rows.
// The query must end, whatever comes out of it.
TEST_F(SqliteFile, DamageEndsInAnErrorOrInFewerMessages) {
  const std::string whole = directory_.Read("bag.db3");
  std::size_t refused = 0;
  for (std::size_t at = 16; at < whole.size(); at += 37) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    const std::vector<std::string> messages = Read(directory_.Write("damaged.db3", damaged), {0, 1, 2});
    ASSERT_LE(messages.size(), 5U) << at;
    if (messages.size() == 1) ++refused;
  }
  EXPECT_GT(refused, 0U);
  for (std::size_t bytes = 0; bytes < whole.size(); bytes += 512)
    ASSERT_LE(Read(directory_.Write("cut.db3", whole.substr(0, bytes)), {0, 1, 2}).size(), 5U) << bytes;
}

}  // namespace
}  // namespace cairn::bag
