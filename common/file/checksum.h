// A checksum of bytes against damage, not against forgery.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace cairn {

static_assert(std::endian::native == std::endian::little, "the bytes are summed as words in memory order");

// FNV-1a (Fowler, Noll, Vo 1991) over words of eight bytes, which is faster than over single bytes. Every step is
// invertible, so a change within one word always changes the sum. `sum` is the sum of what comes before.
[[nodiscard]] inline std::uint64_t ChecksumOf(std::string_view bytes, std::uint64_t sum = 0xcbf29ce484222325) {
  sum ^= bytes.size();
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(std::uint64_t)) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, std::min(sizeof(word), bytes.size() - at));
    sum = (sum ^ word) * 0x100000001b3;
    sum ^= sum >> 32;
  }
  return sum;
}

}  // namespace cairn
