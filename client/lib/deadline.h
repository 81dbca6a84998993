// The moment until which a call of the library waits, from the seconds that its caller allows.
#pragma once

#include <chrono>

namespace cairn::client {

using Deadline = std::chrono::steady_clock::time_point;

[[nodiscard]] inline Deadline DeadlineAfter(double seconds) {
  using Clock = std::chrono::steady_clock;
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace cairn::client
