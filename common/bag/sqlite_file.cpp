#include "common/bag/sqlite_file.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace cairn::bag {
namespace {

constexpr int kMaxValueBytes = 64 << 20;  // Of a text or a message that is read.
// SQLite counts its steps in units of so many. Reading and sorting a row takes some tens of steps, and a row has at
// least ten bytes: a file that needs more has rows that are stored once and found many times.
constexpr int kStepsPerCall = 10'000;
constexpr std::uint64_t kStepsPerByte = 20;

// A recorder may have chosen the format with a log of its own beside the file (rosbag2: --storage-preset-profile
// resilient). SQLite makes this log anew where it is gone, even for reading: it would leave files beside the bag, and
// fail where it may not write.
bool IsOfEndedLog(const std::filesystem::path& path) {
  constexpr std::streamoff kFormatAt = 18;
  constexpr char kWithLog = 2;
  std::ifstream file(path, std::ios::binary);
  char format = 0;
  file.seekg(kFormatAt);
  file.get(format);
  std::filesystem::path log = path;
  log += "-wal";
  std::error_code error;
  return file && format == kWithLog && !std::filesystem::exists(log, error);
}

// The name of a file that nobody changes, as SQLite takes it.
std::string UriOfUnchanged(const std::filesystem::path& path) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string uri = "file://";
  for (const char c : std::filesystem::absolute(path).string()) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '/';
    uri += plain ? std::string(1, c) : std::string{'%', kDigits[byte / 16], kDigits[byte % 16]};
  }
  return uri + "?immutable=1";
}

// A connection that may be used for one query or two.
class Connection {
 public:
  Connection(const std::filesystem::path& path, bool unchanged)
      : database_(unchanged ? UriOfUnchanged(path) : path.string(),
                  SQLite::OPEN_READONLY | (unchanged ? SQLITE_OPEN_URI : 0)),
        most_calls_(100 + std::filesystem::file_size(path) * kStepsPerByte / kStepsPerCall) {
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
  // For another query.
  void Renew() { calls_left_ = most_calls_; }
  SQLite::Database& operator*() { return database_; }

 private:
  SQLite::Database database_;
  const std::uint64_t most_calls_;
  std::uint64_t calls_left_ = most_calls_;
};

class SqliteFile : public File {
 public:
  SqliteFile(std::filesystem::path path, SqliteUse use) : path_(std::move(path)), use_(use) {}

  Result<void> ReadTopics() {
    return Try([&] {
      const auto connection = Connect();
      SQLite::Statement query(**connection, "SELECT id, name, type, serialization_format FROM topics ORDER BY id");
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
      const auto connection = Connect();
      SQLite::Statement query(
          **connection, "SELECT topic_id, data FROM messages WHERE topic_id IN (" + ids + ") ORDER BY timestamp, id");
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
  // For one query. Throws.
  [[nodiscard]] std::shared_ptr<Connection> Connect() const {
    std::shared_ptr<Connection> connection =
        kept_ != nullptr ? kept_
                         : std::make_shared<Connection>(path_, use_ == SqliteUse::kKeepOpen || IsOfEndedLog(path_));
    connection->Renew();
    if (use_ == SqliteUse::kKeepOpen) kept_ = connection;
    return connection;
  }

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
  const SqliteUse use_;
  mutable std::shared_ptr<Connection> kept_;
  std::vector<Topic> topics_;
  std::vector<std::int64_t> ids_;  // Of the topics, in the database.
  std::vector<std::string> notes_;
};

}  // namespace

Result<std::unique_ptr<File>> OpenSqlite(const std::filesystem::path& path, SqliteUse use) {
  auto file = std::make_unique<SqliteFile>(path, use);
  if (auto read = file->ReadTopics(); !read) return tl::unexpected(read.error());
  return file;
}

}  // namespace cairn::bag
