#include "common/code_points.h"

#include <array>

namespace cairn {

CodePoint FirstCodePoint(std::string_view text) {
  static constexpr std::array<std::uint32_t, 5> kLeast = {0, 0, 0x80, 0x800, 0x10000};  // By the number of bytes.
  const std::uint32_t lead = static_cast<std::uint8_t>(text[0]);
  if (lead < 0x80) return {lead, 1};
  if (lead < 0xc2 || lead > 0xf4) return {};
  const std::size_t bytes = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (bytes > text.size()) return {};
  std::uint32_t value = lead & (0x7fU >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    const std::uint32_t next = static_cast<std::uint8_t>(text[i]);
    if (next >> 6 != 0x02) return {};
    value = value << 6 | (next & 0x3fU);
  }
  const bool is_surrogate = value >= 0xd800 && value <= 0xdfff;
  if (value < kLeast.at(bytes) || is_surrogate || value > 0x10ffff) return {};
  return {value, bytes};
}

bool IsControl(std::uint32_t value) {
  return value < 0x20 || (value >= 0x7f && value < 0xa0) || value == 0x2028 || value == 0x2029;
}

}  // namespace cairn
