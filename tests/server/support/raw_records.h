// The records of a store as they are on the disk, to damage them and to see that they stay. Not thread-safe.
#pragma once

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace cairn::server::testing {

// The owner as a number of SQL.
inline std::string Sql(std::uint64_t owner) {
  return std::to_string(static_cast<std::int64_t>(owner ^ (std::uint64_t{1} << 63)));
}

// The table of a store whose server has stopped.
class RawRecords {
 public:
  explicit RawRecords(const std::filesystem::path& directory) {
    EXPECT_EQ(sqlite3_open((directory / "cairn.db").c_str(), &database_), SQLITE_OK);
  }
  RawRecords(const RawRecords&) = delete;
  RawRecords& operator=(const RawRecords&) = delete;
  ~RawRecords() { sqlite3_close(database_); }

  int Run(const std::string& sql) {
    EXPECT_EQ(sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database_);
    return sqlite3_changes(database_);
  }
  // The bytes of these records, in hexadecimal digits.
  std::vector<std::string> Of(const std::string& where) {
    std::vector<std::string> all;
    const auto take = [](void* to, int, char** values, char**) {
      static_cast<std::vector<std::string>*>(to)->emplace_back(values[0]);
      return 0;
    };
    const std::string sql = "SELECT hex(content) FROM records WHERE " + where + " ORDER BY owner, number";
    EXPECT_EQ(sqlite3_exec(database_, sql.c_str(), take, &all, nullptr), SQLITE_OK) << sqlite3_errmsg(database_);
    return all;
  }

 private:
  sqlite3* database_ = nullptr;
};

}  // namespace cairn::server::testing
