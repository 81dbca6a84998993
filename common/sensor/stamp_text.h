// Stamps as decimal seconds in text, exact to the nanosecond: no detour through double, which cannot hold one.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "common/sensor/stamp.h"

namespace cairn {

// "[-]digits[.digits]"; further decimals than nine are rounded. Nothing for other text or a value beyond int64.
[[nodiscard]] std::optional<Stamp> ParseStamp(std::string_view seconds);

// Seconds with nine decimals; ParseStamp reads it back to the same stamp.
[[nodiscard]] std::string FormatStamp(Stamp stamp);

}  // namespace cairn
