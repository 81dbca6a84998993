// A file that takes what does not fit into memory: records of bytes, each after its length (32 bits, in this machine's
// order). It belongs to one process and cannot be read by another one: its name is removed as soon as it is open, and
// the file when the process ends, however it ends.
// Not thread-safe: one owner.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "common/status.h"

namespace cairn::client {

class SpillFile {
 public:
  // kUnavailable: the file cannot be created. kAlreadyExists: there is a file of that name; it is never overwritten.
  [[nodiscard]] static Result<std::unique_ptr<SpillFile>> Create(const std::string& path);
  ~SpillFile();
  SpillFile(const SpillFile&) = delete;
  SpillFile& operator=(const SpillFile&) = delete;

  // Returns the place of the record. kUnavailable: it was not written, for example because the disk is full.
  [[nodiscard]] Result<std::uint64_t> Append(std::string_view record);
  // kDataLoss: there is no whole record at this place.
  [[nodiscard]] Result<std::string> Read(std::uint64_t place) const;
  // The records before this place will not be read any more: their part of the disk is given back, where the file
  // system can do that.
  void Forget(std::uint64_t place);
  // Removes all records.
  void Clear();
  [[nodiscard]] std::uint64_t size() const { return size_; }  // Bytes.

 private:
  SpillFile(std::string path, int file) : path_(std::move(path)), file_(file) {}

  const std::string path_;
  const int file_;
  std::uint64_t size_ = 0;
};

}  // namespace cairn::client
