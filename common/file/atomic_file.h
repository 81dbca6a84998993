// Writes files so that they are complete or absent: beside the target, flushed to the disk, then renamed over it.
// Not for a file that two programs write at once: the last rename wins. Thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "common/status.h"

namespace cairn {

// A file that is written in pieces: its path holds the new content after Commit, and what it held before in every other
// case, also after a crash. What is not committed is removed. Not thread-safe.
class AtomicFile {
 public:
  // The directory must exist.
  [[nodiscard]] static Result<AtomicFile> Create(const std::filesystem::path& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  // kResourceExhausted: the disk is full.
  [[nodiscard]] Result<void> Append(std::string_view content);
  // Flushes to the disk, and renames.
  [[nodiscard]] Result<void> Commit();

 private:
  AtomicFile(std::filesystem::path path, std::filesystem::path temporary, int descriptor);
  int Close();

  std::filesystem::path path_;
  std::filesystem::path temporary_;
  int descriptor_ = -1;  // Below 0: nothing is left to be removed.
};

// Survives a crash at any moment: afterwards the path holds the old content or the new. Leaves no temporary file
// behind on failure. The directory must exist.
[[nodiscard]] Result<void> WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

// The whole content; kNotFound, or kResourceExhausted if it is longer than `max_bytes`.
[[nodiscard]] Result<std::vector<std::uint8_t>> ReadWholeFile(const std::filesystem::path& path, std::size_t max_bytes);

}  // namespace cairn
