// Names of sites, robots and sensors, and the 64-bit ids that stand for them in keys on the wire.
#pragma once

#include <cstdint>
#include <string_view>

#include "common/status.h"

namespace cairn {

using NameId = std::uint64_t;

// FNV-1a, 64 bits, over the UTF-8 bytes (Fowler, Noll, Vo 1991). Stable for ever: it is on the wire and on disk.
[[nodiscard]] constexpr NameId HashName(std::string_view name) {
  NameId hash = 14695981039346656037ULL;
  for (const char c : name) {
    hash ^= static_cast<unsigned char>(c);
    hash *= 1099511628211ULL;
  }
  return hash;
}

// 1..64 characters of [A-Za-z0-9._-], not starting with '.' or '-'.
[[nodiscard]] Result<void> ValidateName(std::string_view what, std::string_view name);

}  // namespace cairn
