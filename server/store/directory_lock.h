// A lock on the file `lock` of a directory, so that only one process uses the directory. The kernel releases it when
// the process ends in any way. Source: flock(2). Thread rule: any thread.
#pragma once

#include <filesystem>
#include <utility>

#include "common/status.h"

namespace cairn::server {

class DirectoryLock {
 public:
  // ALREADY_EXISTS: another process holds it.
  [[nodiscard]] static Result<DirectoryLock> Take(const std::filesystem::path& directory);
  DirectoryLock() = default;  // Holds nothing.
  DirectoryLock(DirectoryLock&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  DirectoryLock& operator=(DirectoryLock&& other) noexcept {
    std::swap(file_, other.file_);
    return *this;
  }
  ~DirectoryLock();

 private:
  int file_ = -1;
};

}  // namespace cairn::server
