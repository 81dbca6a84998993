#include "common/file/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <fstream>
#include <string>
#include <system_error>

namespace cairn {
namespace {

tl::unexpected<Status> FailErrno(const std::filesystem::path& path, const std::string& act, int error) {
  const auto code = error == ENOENT   ? StatusCode::kNotFound
                    : error == ENOSPC ? StatusCode::kResourceExhausted
                    : error == EACCES ? StatusCode::kPermissionDenied
                                      : StatusCode::kUnavailable;
  return Fail(code, path.string() + ": " + act + ": " + std::generic_category().message(error));
}

// Returns 0 or the error number.
int WriteAll(int descriptor, std::string_view content) {
  while (!content.empty()) {
    const ssize_t count = ::write(descriptor, content.data(), content.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    content.remove_prefix(static_cast<std::size_t>(count));
  }
  return ::fsync(descriptor) == 0 ? 0 : errno;
}

// Makes the rename itself durable. Where the file system cannot sync a directory, this is not an error.
void SyncDirectory(const std::filesystem::path& directory) {
  const int descriptor = ::open(directory.empty() ? "." : directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  static_cast<void>(::fsync(descriptor));
  ::close(descriptor);
}

}  // namespace

Result<void> WriteFileAtomically(const std::filesystem::path& path, std::string_view content) {
  static std::atomic<std::uint64_t> counter{0};
  std::filesystem::path temporary = path;
  temporary += ".tmp." + std::to_string(::getpid()) + "." + std::to_string(counter.fetch_add(1));
  const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (descriptor < 0) return FailErrno(path, "cannot create", errno);
  int error = WriteAll(descriptor, content);
  if (::close(descriptor) != 0 && error == 0) error = errno;
  if (error == 0 && std::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(temporary.c_str());
    return FailErrno(path, "cannot write", error);
  }
  SyncDirectory(path.parent_path());
  return {};
}

Result<std::vector<std::uint8_t>> ReadWholeFile(const std::filesystem::path& path, std::size_t max_bytes) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return Fail(StatusCode::kNotFound, path.string() + (error ? ": " + error.message() : ": not a regular file"));
  }
  const auto size = std::filesystem::file_size(path, error);
  if (error) return Fail(StatusCode::kUnavailable, path.string() + ": " + error.message());
  if (size > max_bytes) {
    return Fail(StatusCode::kResourceExhausted, path.string() + ": " + std::to_string(size) + " bytes, at most " +
                                                    std::to_string(max_bytes) + " are read");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) return Fail(StatusCode::kPermissionDenied, path.string() + ": cannot be opened");
  std::vector<std::uint8_t> bytes(size);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (static_cast<std::size_t>(file.gcount()) != size)
    return Fail(StatusCode::kDataLoss, path.string() + ": cut short");
  return bytes;
}

}  // namespace cairn
