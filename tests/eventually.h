// Waiting in tests for what no callback announces.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

namespace cairn::test {

// Generous, for sanitizers and a busy machine; never waited for in full.
inline constexpr std::chrono::seconds kDeadline{120};

// Polls; for conditions no callback announces.
inline bool Eventually(const std::function<bool()>& condition, std::chrono::milliseconds deadline = kDeadline) {
  const auto end = std::chrono::steady_clock::now() + deadline;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

}  // namespace cairn::test
