// Time as the sensors stamp it: nanoseconds since the Unix epoch (or any epoch a log uses), int64.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

using Stamp = std::int64_t;

inline constexpr Stamp kNanosPerSecond = 1'000'000'000;

// Rounds to the nearest nanosecond. `seconds` must be finite and within +-9.2e9.
[[nodiscard]] constexpr Stamp StampFromSeconds(double seconds) {
  return static_cast<Stamp>(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5));
}
[[nodiscard]] constexpr double SecondsFromStamp(Stamp stamp) {
  return static_cast<double>(stamp) * 1e-9;
}

// later - earlier without overflow, for stamps a broken clock may place anywhere in int64.
[[nodiscard]] constexpr std::uint64_t NanosBetween(Stamp earlier, Stamp later) {
  return static_cast<std::uint64_t>(later) - static_cast<std::uint64_t>(earlier);
}

// Stamps as decimal seconds in text, exact to the nanosecond: no detour through double, which cannot hold one.
// "[-]digits[.digits]"; further decimals than nine are rounded. Nothing for other text or a value beyond int64.
[[nodiscard]] std::optional<Stamp> ParseStamp(std::string_view seconds);

// Seconds with nine decimals; ParseStamp reads it back to the same stamp.
[[nodiscard]] std::string FormatStamp(Stamp stamp);

}  // namespace cairn
