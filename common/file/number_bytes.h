// Numbers as the bytes in which files keep them: little-endian, as they lie in memory. Stateless, thread-safe.
#pragma once

#include <bit>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

namespace cairn {

static_assert(std::endian::native == std::endian::little, "numbers are written as they are in memory");

template <typename Number>
requires std::is_arithmetic_v<Number>
[[nodiscard]] std::string BytesOfNumber(Number number) {
  std::string bytes(sizeof(Number), '\0');
  std::memcpy(bytes.data(), &number, sizeof(Number));
  return bytes;
}

// REQUIRES: so many bytes lie there.
template <typename Number>
requires std::is_arithmetic_v<Number>
[[nodiscard]] Number NumberAt(const char* bytes) {
  Number number{};
  std::memcpy(&number, bytes, sizeof(Number));
  return number;
}

// The number at the beginning of `bytes`, which it is taken from. Nothing, and `bytes` stay: they are too few.
template <typename Number>
requires std::is_arithmetic_v<Number>
[[nodiscard]] std::optional<Number> TakeNumber(std::string_view& bytes) {
  if (bytes.size() < sizeof(Number)) return std::nullopt;
  const auto number = NumberAt<Number>(bytes.data());
  bytes.remove_prefix(sizeof(Number));
  return number;
}

}  // namespace cairn
