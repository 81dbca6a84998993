#include "common/bag/sqlite_file.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <system_error>
#include <utility>

namespace cairn::bag {
namespace {

constexpr int kMaxValueBytes = 64 << 20;  // Of a text or a message that is read.
// SQLite counts its steps in units of so many. Reading and sorting a row takes some tens of steps, and a row has at
// least ten bytes: a file that needs more has rows that are stored once and found many times.
constexpr int kStepsPerCall = 10'000;
constexpr std::uint64_t kStepsPerByte = 20;

// A connection that may be used for one query or two.
class Connection {
 public:
  explicit Connection(const std::filesystem::path& path)
      : database_(path.string(), SQLite::OPEN_READONLY),
        calls_left_(100 + std::filesystem::file_size(path) * kStepsPerByte / kStepsPerCall) {
    sqlite3* const handle = database_.getHandle();
    for (const int off : {SQLITE_DBCONFIG_ENABLE_VIEW, SQLITE_DBCONFIG_ENABLE_TRIGGER, SQLITE_DBCONFIG_TRUSTED_SCHEMA})
      sqlite3_db_config(handle, off, 0, nullptr);
    sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, kMaxValueBytes);
    sqlite3_progress_handler(
        handle, kStepsPerCall, [](void* left) { return (*static_cast<std::uint64_t*>(left))-- == 0 ? 1 : 0; },
        &calls_left_);
    database_.exec("PRAGMA cell_size_check = ON");
  }
  SQLite::Database& operator*() { return database_; }

 private:
  SQLite::Database database_;
  std::uint64_t calls_left_;
};

class SqliteFile : public File {
 public:
  explicit SqliteFile(std::filesystem::path path) : path_(std::move(path)) {}

  Result<void> ReadTopics() {
    return Try([&] {
      Connection connection(path_);
      SQLite::Statement query(*connection, "SELECT id, name, type, serialization_format FROM topics ORDER BY id");
      while (query.executeStep()) {
        if (topics_.size() >= kMaxTopics)
          return Result<void>(Fail(StatusCode::kDataLoss, path_.string() + ": too many topics"));
        ids_.push_back(query.getColumn(0).getInt64());
        topics_.push_back(
            {query.getColumn(1).getString(), query.getColumn(2).getString(), query.getColumn(3).getString()});
      }
      return Result<void>();
    });
  }

  [[nodiscard]] const std::vector<Topic>& topics() const override { return topics_; }
  [[nodiscard]] const std::vector<std::string>& notes() const override { return notes_; }

  [[nodiscard]] Result<void> Read(const std::vector<std::size_t>& wanted, const Sink& sink) const override {
    std::string ids;
    for (const std::size_t topic : wanted) ids += (ids.empty() ? "" : ",") + std::to_string(ids_[topic]);
    return Try([&] {
      Connection connection(path_);
      SQLite::Statement query(
          *connection, "SELECT topic_id, data FROM messages WHERE topic_id IN (" + ids + ") ORDER BY timestamp, id");
      while (query.executeStep()) {
        const std::int64_t id = query.getColumn(0).getInt64();
        const SQLite::Column data = query.getColumn(1);
        const std::string_view bytes(static_cast<const char*>(data.getBlob()),
                                     static_cast<std::size_t>(data.getBytes()));
        for (const std::size_t topic : wanted)
          if (ids_[topic] == id && !sink(topic, bytes)) return Result<void>();
      }
      return Result<void>();
    });
  }

 private:
  // Exceptions of SQLiteCpp end here.
  template <typename Work>
  Result<void> Try(const Work& work) const {
    try {
      return work();
    } catch (const SQLite::Exception& error) {
      const bool too_long = error.getErrorCode() == SQLITE_INTERRUPT;
      return Fail(StatusCode::kDataLoss,
                  path_.string() + ": " + (too_long ? "the tables refer to themselves" : error.what()));
    } catch (const std::filesystem::filesystem_error& error) {
      return Fail(StatusCode::kNotFound, path_.string() + ": " + error.code().message());
    }
  }

  const std::filesystem::path path_;
  std::vector<Topic> topics_;
  std::vector<std::int64_t> ids_;  // Of the topics, in the database.
  std::vector<std::string> notes_;
};

}  // namespace

Result<std::unique_ptr<File>> OpenSqlite(const std::filesystem::path& path) {
  auto file = std::make_unique<SqliteFile>(path);
  if (auto read = file->ReadTopics(); !read) return tl::unexpected(read.error());
  return file;
}

}  // namespace cairn::bag
