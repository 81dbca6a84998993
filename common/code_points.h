// Reads text that may come from strangers, code point by code point. Pure functions, thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace cairn {

// A code point and the number of bytes that it takes in UTF-8.
struct CodePoint {
  std::uint32_t value = 0;
  std::size_t bytes = 0;  // 0: it is not UTF-8 (RFC 3629).
};

// The first one of a text that is not empty.
[[nodiscard]] CodePoint FirstCodePoint(std::string_view text);

// Control characters, and the two separators that some programs take for the end of a line.
[[nodiscard]] bool IsControl(std::uint32_t value);

}  // namespace cairn
