#include "common/file/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>

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
  return 0;
}

// Makes the rename itself durable. Where the file system cannot sync a directory, this is not an error.
void SyncDirectory(const std::filesystem::path& directory) {
  const int descriptor = ::open(directory.empty() ? "." : directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  static_cast<void>(::fsync(descriptor));
  ::close(descriptor);
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path path, std::filesystem::path temporary, int descriptor)
    : path_(std::move(path)), temporary_(std::move(temporary)), descriptor_(descriptor) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)),
      descriptor_(std::exchange(other.descriptor_, -1)) {}

AtomicFile::~AtomicFile() {
  if (descriptor_ < 0) return;
  Close();
  ::unlink(temporary_.c_str());
}

Result<AtomicFile> AtomicFile::Create(const std::filesystem::path& path) {
  static std::atomic<std::uint64_t> counter{0};
  std::filesystem::path temporary = path;
  temporary += ".tmp." + std::to_string(::getpid()) + "." + std::to_string(counter.fetch_add(1));
  const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (descriptor < 0) return FailErrno(path, "cannot create", errno);
  return AtomicFile(path, std::move(temporary), descriptor);
}

int AtomicFile::Close() {
  return ::close(std::exchange(descriptor_, -1)) == 0 ? 0 : errno;
}

Result<void> AtomicFile::Append(std::string_view content) {
  if (const int error = WriteAll(descriptor_, content); error != 0) return FailErrno(path_, "cannot write", error);
  return {};
}

Result<void> AtomicFile::Commit() {
  int error = ::fsync(descriptor_) == 0 ? 0 : errno;
  if (const int closed = Close(); error == 0) error = closed;
  if (error == 0 && std::rename(temporary_.c_str(), path_.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(temporary_.c_str());
    return FailErrno(path_, "cannot write", error);
  }
  SyncDirectory(path_.parent_path());
  return {};
}

Result<void> WriteFileAtomically(const std::filesystem::path& path, std::string_view content) {
  auto file = AtomicFile::Create(path);
  if (!file) return tl::unexpected(file.error());
  if (auto written = file->Append(content); !written) return written;
  return file->Commit();
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
