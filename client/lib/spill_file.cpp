#include "client/lib/spill_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "common/file/number_bytes.h"

namespace cairn::client {
namespace {

std::string ErrnoText(int error) {
  return std::generic_category().message(error);
}

bool WriteAll(int file, std::string_view bytes, std::uint64_t place) {
  while (!bytes.empty()) {
    const ssize_t written = pwrite(file, bytes.data(), bytes.size(), static_cast<off_t>(place));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
    place += static_cast<std::uint64_t>(written);
  }
  return true;
}

bool ReadAll(int file, char* bytes, std::size_t size, std::uint64_t place) {
  while (size > 0) {
    const ssize_t got = pread(file, bytes, size, static_cast<off_t>(place));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    bytes += got;
    size -= static_cast<std::size_t>(got);
    place += static_cast<std::uint64_t>(got);
  }
  return true;
}

}  // namespace

Result<std::unique_ptr<SpillFile>> SpillFile::Create(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0) {
    const int error = errno;
    if (error == EEXIST) {
      return Fail(StatusCode::kAlreadyExists, path + ": the file exists; a spill file must be a new one");
    }
    return Fail(StatusCode::kUnavailable, path + ": cannot be made: " + ErrnoText(error));
  }
  // It is of no use to another process, and one that is killed could not remove it.
  unlink(path.c_str());
  return std::unique_ptr<SpillFile>(new SpillFile(path, file));
}

SpillFile::~SpillFile() {
  close(file_);
}

Result<std::uint64_t> SpillFile::Append(std::string_view record) {
  std::string bytes = BytesOfNumber(static_cast<std::uint32_t>(record.size()));
  bytes += record;
  if (!WriteAll(file_, bytes, size_)) {
    return Fail(StatusCode::kUnavailable, path_ + ": cannot be written: " + ErrnoText(errno));
  }
  return std::exchange(size_, size_ + bytes.size());
}

Result<std::string> SpillFile::Read(std::uint64_t place) const {
  std::uint32_t length = 0;
  const Status torn{StatusCode::kDataLoss, path_ + ": cannot be read at " + std::to_string(place)};
  if (!ReadAll(file_, reinterpret_cast<char*>(&length), sizeof(length), place)) return tl::unexpected(torn);
  if (length > size_) return tl::unexpected(torn);
  std::string record(length, '\0');
  if (!ReadAll(file_, record.data(), record.size(), place + sizeof(length))) return tl::unexpected(torn);
  return record;
}

void SpillFile::Forget(std::uint64_t place) {
  fallocate(file_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, static_cast<off_t>(place));
}

void SpillFile::Clear() {
  if (size_ > 0 && ftruncate(file_, 0) == 0) size_ = 0;
}

}  // namespace cairn::client
