#include "common/bag/readable_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace cairn::bag {

Result<ReadableFile> ReadableFile::Open(const std::filesystem::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return Fail(StatusCode::kNotFound, path.string() + ": " + std::strerror(errno));
  ReadableFile opened(file, 0);
  struct stat about {};
  if (fstat(file, &about) != 0 || !S_ISREG(about.st_mode))
    return Fail(StatusCode::kNotFound, path.string() + ": not a regular file");
  opened.size_ = static_cast<std::uint64_t>(about.st_size);
  return opened;
}

ReadableFile::~ReadableFile() {
  if (file_ >= 0) close(file_);
}

Result<std::string> ReadableFile::Read(std::uint64_t offset, std::size_t bytes) const {
  std::string content(bytes, '\0');
  std::size_t done = 0;
  while (done < bytes) {
    const ssize_t got = pread(file_, content.data() + done, bytes - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return Fail(StatusCode::kDataLoss, "byte " + std::to_string(offset + done) + " cannot be read");
    done += static_cast<std::size_t>(got);
  }
  return content;
}

}  // namespace cairn::bag
