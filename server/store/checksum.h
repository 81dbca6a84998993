// The checksum of saved sites, and of records of format 1: FNV-1a over bytes, 64 bits (Fowler, Noll, Vo 1991). Every
// step is invertible, so one changed byte always changes the sum. Not thread-safe.
#pragma once

#include <cstdint>
#include <string_view>

namespace cairn::server {

class Checksum {
 public:
  void Add(std::uint64_t number) {
    for (int i = 0; i < 8; ++i) Add(static_cast<unsigned char>(number >> (8 * i)));
  }
  void Add(std::string_view bytes) {
    for (const char c : bytes) Add(static_cast<unsigned char>(c));
  }
  [[nodiscard]] std::uint64_t value() const { return sum_; }

 private:
  void Add(unsigned char byte) {
    sum_ ^= byte;
    sum_ *= 1099511628211ULL;
  }
  std::uint64_t sum_ = 14695981039346656037ULL;
};

}  // namespace cairn::server
