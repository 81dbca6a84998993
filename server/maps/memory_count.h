// Sums what shared values take in memory, each of them once. A plain value.
#pragma once

#include <cstddef>
#include <memory>
#include <unordered_set>

namespace cairn::server {

class MemoryCount {
 public:
  // Null counts nothing.
  template <typename T>
  void Add(const std::shared_ptr<T>& shared, std::size_t bytes) {
    if (shared != nullptr && seen_.insert(shared.get()).second) bytes_ += bytes;
  }
  // Of what is not shared.
  void Add(std::size_t bytes) { bytes_ += bytes; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  std::unordered_set<const void*> seen_;
  std::size_t bytes_ = 0;
};

}  // namespace cairn::server
