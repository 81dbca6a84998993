#include "server/store/sqlite_store.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <bit>
#include <optional>
#include <system_error>
#include <utility>

#include "common/mutex.h"
#include "server/store/directory_lock.h"
#include "server/store/envelope.h"

namespace cairn::server {
namespace {

// All SQL of the server. `number` orders the records of an owner. SQLite's integers are signed: numbers are stored with
// their highest bit turned over, so that the order of the table is the order of unsigned numbers.
constexpr int kApplication = 0x43726e31;  // "Crn1": says that a database is ours.
constexpr int kSchema = 1;                // Version of the tables.
constexpr const char* kSetUp =
    "PRAGMA locking_mode = EXCLUSIVE;"  // One process: no file for shared memory is needed.
    "PRAGMA journal_mode = WAL;"
    "PRAGMA synchronous = FULL;"  // Every commit is flushed.
    // In pages of 4 KiB: how long the write-ahead log gets before it is copied into the database. Checkpoints replace
    // their records within seconds; what was replaced in the log is never copied.
    "PRAGMA wal_autocheckpoint = 4000;"
    // What a large commit has made of the log is given back. What is removed is not overwritten with zeros, as Debian's
    // SQLite does by default: to remove a gigabyte would write a gigabyte.
    "PRAGMA journal_size_limit = 67108864;"
    "PRAGMA secure_delete = OFF;"
    "PRAGMA cell_size_check = ON;";
constexpr const char* kMakeTables =
    "CREATE TABLE records (kind INTEGER NOT NULL, owner INTEGER NOT NULL, number INTEGER NOT NULL,"
    " content BLOB NOT NULL, PRIMARY KEY (kind, owner, number));";
constexpr const char* kPut = "INSERT OR REPLACE INTO records (kind, owner, number, content) VALUES (?, ?, ?, ?)";
constexpr const char* kRemove = "DELETE FROM records WHERE kind = ? AND owner = ? AND number BETWEEN ? AND ?";
constexpr const char* kRemoveFirst =
    "DELETE FROM records WHERE rowid IN (SELECT rowid FROM records"
    " WHERE kind = ? AND owner = ? AND number BETWEEN ? AND ? ORDER BY number LIMIT ?)";
constexpr const char* kRead =
    "SELECT number, content FROM records WHERE kind = ? AND owner = ? AND number BETWEEN ? AND ? ORDER BY number";
constexpr const char* kNumbers =
    "SELECT number FROM records WHERE kind = ? AND owner = ? AND number BETWEEN ? AND ? ORDER BY number";
// From each owner to the next by the index. DISTINCT would read the keys of all records.
constexpr const char* kOwners =
    "WITH RECURSIVE owners(owner) AS (SELECT min(owner) FROM records WHERE kind = ?1 UNION ALL"
    " SELECT (SELECT min(owner) FROM records WHERE kind = ?1 AND owner > owners.owner) FROM owners"
    " WHERE owner IS NOT NULL) SELECT owner FROM owners WHERE owner IS NOT NULL ORDER BY owner";

std::int64_t ToSql(std::uint64_t number) {
  return std::bit_cast<std::int64_t>(number ^ (std::uint64_t{1} << 63));
}

std::uint64_t FromSql(std::int64_t number) {
  return std::bit_cast<std::uint64_t>(number) ^ (std::uint64_t{1} << 63);
}

Status StatusOf(const SQLite::Exception& error, const std::string& doing) {
  const auto code = [&error] {
    switch (error.getErrorCode()) {
      case SQLITE_FULL:
        return StatusCode::kResourceExhausted;
      case SQLITE_CORRUPT:
      case SQLITE_NOTADB:
        return StatusCode::kDataLoss;
      default:
        return StatusCode::kUnavailable;
    }
  };
  return {code(), doing + ": " + error.what()};
}

void BindRange(SQLite::Statement& statement, const RecordRange& range) {
  statement.bind(1, static_cast<int>(range.kind));
  statement.bind(2, ToSql(range.owner));
  statement.bind(3, ToSql(range.first));
  statement.bind(4, ToSql(range.last));
}

// A statement is reset when its use ends, also by an exception.
class Use {
 public:
  explicit Use(SQLite::Statement& statement) : statement_(statement) {}
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;
  ~Use() { statement_.tryReset(); }
  SQLite::Statement* operator->() { return &statement_; }
  SQLite::Statement& operator*() { return statement_; }

 private:
  SQLite::Statement& statement_;
};

class SqliteStore : public Store {
 public:
  // REQUIRES: Check has accepted the database.
  SqliteStore(std::filesystem::path directory, SQLite::Database database, DirectoryLock lock)
      : directory_(std::move(directory)), lock_(std::move(lock)), database_(std::move(database)) {
    database_.exec(kSetUp);
    if (int version = Pragma("user_version"); version == 0) MakeTables();
    put_.emplace(database_, kPut);
    remove_.emplace(database_, kRemove);
    remove_first_.emplace(database_, kRemoveFirst);
    read_.emplace(database_, kRead);
    owners_.emplace(database_, kOwners);
    numbers_.emplace(database_, kNumbers);
  }

  // The tables' version, and whether they are ours. The connection goes on being used: to open a second one reads the
  // whole write-ahead log again.
  static Result<void> Check(SQLite::Database& database, const std::string& path) {
    const auto copies_log_at_close = [&database](bool copies) {
      sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, copies ? 0 : 1, nullptr);
    };
    copies_log_at_close(false);  // What is not ours is left as it is.
    database.exec("PRAGMA locking_mode = EXCLUSIVE");
    const int version = database.execAndGet("PRAGMA user_version").getInt();
    const int application = database.execAndGet("PRAGMA application_id").getInt();
    const int tables = database.execAndGet("SELECT count(*) FROM sqlite_master").getInt();
    if (version != 0 || tables != 0) {
      if (application != kApplication) return Fail(StatusCode::kDataLoss, "'" + path + "' is not a store of cairnd");
      if (version > kSchema) {
        return Fail(StatusCode::kFailedPrecondition,
                    "'" + path + "' was written by a newer server (tables of version " + std::to_string(version) +
                        "; this one reads " + std::to_string(kSchema) + ")");
      }
    }
    copies_log_at_close(true);
    return {};
  }

  Result<void> Commit(const RecordChanges& changes) override {
    for (const Record& record : changes.put)
      if (auto fits = CheckLength(record); !fits) return fits;
    const MutexLock lock(mutex_);
    try {
      SQLite::Transaction transaction(database_, SQLite::TransactionBehavior::IMMEDIATE);
      for (const RecordRange& range : changes.removed) {
        Use remove(*remove_);
        BindRange(*remove, range);
        remove->exec();
      }
      for (const Record& record : changes.put) Put(record);
      transaction.commit();
      return {};
    } catch (const SQLite::Exception& error) {
      return tl::unexpected(StatusOf(error, "cannot write to the store"));
    }
  }

  Result<void> CommitEach(const Next& next) override {
    const MutexLock lock(mutex_);
    try {
      SQLite::Transaction transaction(database_, SQLite::TransactionBehavior::IMMEDIATE);
      for (;;) {
        const auto record = next();
        if (!record) return tl::unexpected(record.error());  // The transaction is rolled back.
        if (!*record) break;
        if (auto fits = CheckLength(**record); !fits) return fits;
        Put(**record);
      }
      transaction.commit();
      return {};
    } catch (const SQLite::Exception& error) {
      return tl::unexpected(StatusOf(error, "cannot write to the store"));
    }
  }

  Result<std::size_t> RemoveFirst(const RecordRange& range, std::size_t count) override {
    const MutexLock lock(mutex_);
    try {
      SQLite::Transaction transaction(database_, SQLite::TransactionBehavior::IMMEDIATE);
      Use remove(*remove_first_);
      BindRange(*remove, range);
      remove->bind(5, static_cast<std::int64_t>(count));
      const int removed = remove->exec();
      transaction.commit();
      return static_cast<std::size_t>(removed);
    } catch (const SQLite::Exception& error) {
      return tl::unexpected(StatusOf(error, "cannot write to the store"));
    }
  }

  Result<void> Read(const RecordRange& range, const Visit& visit) override {
    const MutexLock lock(mutex_);
    try {
      Use read(*read_);
      BindRange(*read, range);
      while (read->executeStep()) {
        const std::uint64_t number = FromSql(read->getColumn(0).getInt64());
        const SQLite::Column content = read->getColumn(1);
        auto opened = codec_.Open({range.kind, range.owner, number}, {static_cast<const char*>(content.getBlob()),
                                                                      static_cast<std::size_t>(content.getBytes())});
        if (!opened) return tl::unexpected(opened.error());
        if (auto visited = visit(number, *std::move(opened)); !visited) return visited;
      }
      return {};
    } catch (const SQLite::Exception& error) {
      return tl::unexpected(StatusOf(error, "cannot read the store"));
    }
  }

  Result<std::vector<std::uint64_t>> Owners(RecordKind kind) override {
    const MutexLock lock(mutex_);
    try {
      Use owners(*owners_);
      owners->bind(1, static_cast<int>(kind));
      std::vector<std::uint64_t> found;
      while (owners->executeStep()) found.push_back(FromSql(owners->getColumn(0).getInt64()));
      return found;
    } catch (const SQLite::Exception& error) {
      return tl::unexpected(StatusOf(error, "cannot read the store"));
    }
  }

  Result<std::vector<std::uint64_t>> Numbers(const RecordRange& range) override {
    const MutexLock lock(mutex_);
    try {
      Use numbers(*numbers_);
      BindRange(*numbers, range);
      std::vector<std::uint64_t> found;
      while (numbers->executeStep()) found.push_back(FromSql(numbers->getColumn(0).getInt64()));
      return found;
    } catch (const SQLite::Exception& error) {
      return tl::unexpected(StatusOf(error, "cannot read the store"));
    }
  }

  std::filesystem::path directory() const override { return directory_; }

  Result<std::uint64_t> bytes_used() override {
    const MutexLock lock(mutex_);
    try {
      const int pages = Pragma("page_count") - Pragma("freelist_count");
      return static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(Pragma("page_size"));
    } catch (const SQLite::Exception& error) {
      return tl::unexpected(StatusOf(error, "cannot read the store"));
    }
  }

 private:
  Result<void> CheckLength(const Record& record) const {
    if (record.bytes.size() <= max_record_bytes()) return {};
    return Fail(StatusCode::kOutOfRange, "a record of " + std::to_string(record.bytes.size()) +
                                             " bytes is too long for the store; " + std::to_string(max_record_bytes()) +
                                             " are possible");
  }

  int Pragma(const std::string& name) { return database_.execAndGet("PRAGMA " + name).getInt(); }

  void MakeTables() {
    SQLite::Transaction transaction(database_, SQLite::TransactionBehavior::IMMEDIATE);
    database_.exec(kMakeTables);
    database_.exec("PRAGMA application_id = " + std::to_string(kApplication));
    database_.exec("PRAGMA user_version = " + std::to_string(kSchema));
    transaction.commit();
  }

  void Put(const Record& record) CAIRN_REQUIRES(mutex_) {
    const std::string sealed = codec_.Seal(record.key, record.bytes);
    Use put(*put_);
    put->bind(1, static_cast<int>(record.key.kind));
    put->bind(2, ToSql(record.key.owner));
    put->bind(3, ToSql(record.key.number));
    put->bindNoCopy(4, sealed.data(), static_cast<int>(sealed.size()));
    put->exec();
  }

  const std::filesystem::path directory_;  // Empty: in memory.
  const DirectoryLock lock_;
  Mutex mutex_;
  SQLite::Database database_;
  EnvelopeCodec codec_ CAIRN_GUARDED_BY(mutex_);
  // Set in the constructor, after the tables exist.
  std::optional<SQLite::Statement> put_, remove_, remove_first_, read_, owners_, numbers_;
};

}  // namespace

Result<std::unique_ptr<Store>> OpenStore(const std::filesystem::path& directory, const std::string& vfs) {
  const bool in_memory = directory == kInMemory;
  const std::string path = in_memory ? std::string(kInMemory) : (directory / "cairn.db").string();
  try {
    DirectoryLock lock;
    if (!in_memory) {
      std::filesystem::create_directories(directory);
      auto taken = DirectoryLock::Take(directory);
      if (!taken) return tl::unexpected(taken.error());
      lock = std::move(*taken);
    }
    SQLite::Database database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, 0, vfs);
    if (auto checked = SqliteStore::Check(database, path); !checked) return tl::unexpected(checked.error());
    return std::make_unique<SqliteStore>(in_memory ? std::filesystem::path() : directory, std::move(database),
                                         std::move(lock));
  } catch (const SQLite::Exception& error) {
    return tl::unexpected(StatusOf(error, "cannot open the store '" + path + "'"));
  } catch (const std::filesystem::filesystem_error& error) {
    return Fail(StatusCode::kUnavailable,
                "cannot make the state directory '" + directory.string() + "': " + error.code().message());
  }
}

}  // namespace cairn::server
