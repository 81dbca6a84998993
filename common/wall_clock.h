// The time of day of this machine, as sensors stamp it. It may be set back; waits use steady clocks. Thread-safe.
#pragma once

#include <chrono>

#include "common/sensor/stamp.h"

namespace cairn {

inline constexpr Stamp kNanosPerMillisecond = 1'000'000;

// Nanoseconds since 1970.
[[nodiscard]] inline Stamp WallClock() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(since_1970).count();
}

}  // namespace cairn
