#include "common/sensor/stamp.h"

#include <limits>

namespace cairn {
namespace {

bool IsDigit(char c) {
  return c >= '0' && c <= '9';
}

}  // namespace

std::optional<Stamp> ParseStamp(std::string_view seconds) {
  const bool negative = !seconds.empty() && seconds.front() == '-';
  if (negative) seconds.remove_prefix(1);
  // Magnitude in nanoseconds; checked against the largest int64 before every digit.
  constexpr std::uint64_t kLimit = std::numeric_limits<Stamp>::max();
  std::uint64_t nanos = 0;
  std::size_t i = 0, decimals = 0;
  bool any = false, in_fraction = false, round_up = false;
  for (; i < seconds.size(); ++i) {
    const char c = seconds[i];
    if (c == '.' && !in_fraction) {
      in_fraction = true;
      continue;
    }
    if (!IsDigit(c)) return std::nullopt;
    any = true;
    if (in_fraction && ++decimals > 9) {
      if (decimals == 10) round_up = c >= '5';
      continue;
    }
    const auto digit = static_cast<std::uint64_t>(c - '0');
    if (nanos > (kLimit - digit) / 10) return std::nullopt;
    nanos = nanos * 10 + digit;
  }
  if (!any) return std::nullopt;
  for (; decimals < 9; ++decimals) {
    if (nanos > kLimit / 10) return std::nullopt;
    nanos *= 10;
  }
  if (round_up) ++nanos;
  if (nanos > kLimit) return std::nullopt;
  return negative ? -static_cast<Stamp>(nanos) : static_cast<Stamp>(nanos);
}

std::string FormatStamp(Stamp stamp) {
  // Unsigned magnitude, because the most negative int64 has no positive twin.
  const auto bits = static_cast<std::uint64_t>(stamp);
  const std::uint64_t magnitude = stamp < 0 ? 0 - bits : bits;
  const std::string fraction = std::to_string(magnitude % kNanosPerSecond);
  return (stamp < 0 ? "-" : "") + std::to_string(magnitude / kNanosPerSecond) + "." +
         std::string(9 - fraction.size(), '0') + fraction;
}

}  // namespace cairn
