// Reads the databases in which ROS 2 records by default up to Humble (rosbag2_storage_sqlite3): a table of topics and a
// table of messages. The database is opened for reading only. What a hostile one could do is ruled out: its views and
// triggers are off, its functions are not trusted, and the number of steps of a query is bounded by the file's length.
#pragma once

#include <filesystem>
#include <memory>

#include "common/bag/bag_file.h"

namespace cairn::bag {

// kKeepOpen: nobody else uses the file, and its path is not used again after this call. Otherwise the file is opened
// for each reading: a bag may have more files than a process may have open.
enum class SqliteUse { kOpenEachTime, kKeepOpen };
[[nodiscard]] Result<std::unique_ptr<File>> OpenSqlite(const std::filesystem::path& path,
                                                       SqliteUse use = SqliteUse::kOpenEachTime);

}  // namespace cairn::bag
