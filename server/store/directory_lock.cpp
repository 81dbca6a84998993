#include "server/store/directory_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

namespace cairn::server {

Result<DirectoryLock> DirectoryLock::Take(const std::filesystem::path& directory) {
  const std::string path = (directory / "lock").string();
  DirectoryLock lock;
  lock.file_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock.file_ < 0) {
    return Fail(StatusCode::kUnavailable, "cannot open '" + path + "': " + std::strerror(errno));
  }
  if (flock(lock.file_, LOCK_EX | LOCK_NB) == 0) return lock;
  if (errno != EWOULDBLOCK) {
    return Fail(StatusCode::kUnavailable, "cannot lock '" + path + "': " + std::strerror(errno));
  }
  return Fail(StatusCode::kAlreadyExists, "another server uses the state directory '" + directory.string() +
                                              "'; stop it, or name another directory (--state)");
}

DirectoryLock::~DirectoryLock() {
  if (file_ >= 0) close(file_);
}

}  // namespace cairn::server
