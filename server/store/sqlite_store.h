// The embedded store: one SQLite database in a directory, `cairn.db`, with a write-ahead log beside it. Every commit is
// flushed to the disk. Only one process can use it: the directory is locked while the store is open, and the kernel
// releases the lock when the process ends, also by SIGKILL. Sources: sqlite.org/wal.html, flock(2). Thread rule: any
// thread.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "server/store/store.h"

namespace cairn::server {

// Instead of a directory: the store is in memory and is lost when the process ends.
inline constexpr std::string_view kInMemory = ":memory:";

// Creates the directory if it does not exist. ALREADY_EXISTS: another process uses it. FAILED_PRECONDITION: a newer
// server has written it. DATA_LOSS: it is not a store, or it is damaged. UNAVAILABLE: it cannot be written. `vfs` names
// the file system of SQLite, for tests that make it fail; empty: the default.
[[nodiscard]] Result<std::unique_ptr<Store>> OpenStore(const std::filesystem::path& directory,
                                                       const std::string& vfs = {});

}  // namespace cairn::server
