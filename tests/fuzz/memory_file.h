// A file in memory with a name that readers of files can open. One for the whole process: no file system is worn out by
// a million inputs.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <string_view>

#include "tests/fuzz/fuzz_target.h"

namespace cairn::fuzz {

class MemoryFile {
 public:
  MemoryFile() : file_(memfd_create("cairn_fuzz", MFD_CLOEXEC)) { Must(file_ >= 0, "a file in memory"); }
  ~MemoryFile() { close(file_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  // The name of the file, which now holds these bytes.
  [[nodiscard]] std::filesystem::path With(std::string_view bytes) const {
    Must(ftruncate(file_, 0) == 0, "the file can be emptied");
    Must(pwrite(file_, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()), "the file can be written");
    return "/proc/self/fd/" + std::to_string(file_);
  }
  // What it holds now.
  [[nodiscard]] std::string Read() const {
    std::string bytes(static_cast<std::size_t>(lseek(file_, 0, SEEK_END)), '\0');
    Must(pread(file_, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()), "the file can be read");
    return bytes;
  }

 private:
  int file_;
};

}  // namespace cairn::fuzz
