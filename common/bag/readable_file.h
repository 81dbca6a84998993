// A file that is read at places of the reader's choice. Thread rule: one owner; reads may come from any thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include "common/status.h"

namespace cairn::bag {

class ReadableFile {
 public:
  [[nodiscard]] static Result<ReadableFile> Open(const std::filesystem::path& path);
  ReadableFile(ReadableFile&& other) noexcept : file_(std::exchange(other.file_, -1)), size_(other.size_) {}
  ReadableFile& operator=(ReadableFile&& other) noexcept {
    std::swap(file_, other.file_);
    size_ = other.size_;
    return *this;
  }
  ~ReadableFile();

  [[nodiscard]] std::uint64_t size() const { return size_; }
  // Exactly so many bytes. The caller has bounded the number. DATA_LOSS: the file has become shorter, or the disk
  // fails.
  [[nodiscard]] Result<std::string> Read(std::uint64_t offset, std::size_t bytes) const;

 private:
  ReadableFile(int file, std::uint64_t size) : file_(file), size_(size) {}

  int file_ = -1;
  std::uint64_t size_ = 0;
};

}  // namespace cairn::bag
