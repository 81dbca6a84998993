// The processor time that the calling thread has used, for comparisons of two moments.
#pragma once

#include <time.h>

#include <chrono>

namespace cairn {

[[nodiscard]] inline std::chrono::nanoseconds ThreadTime() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
}

}  // namespace cairn
