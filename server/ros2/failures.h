// Counts the exceptions that work on a thread of the door ended with (memory that was short), and logs the first of
// them: the thread goes on, and what it was about is lost. Thread-safe.
#pragma once

#include <spdlog/spdlog.h>

#include <atomic>
#include <cstdint>
#include <exception>

namespace cairn::server {

class Failures {
 public:
  // `what`: what is lost, for the log: "a message of a ROS 2 robot".
  explicit Failures(const char* what) : what_(what) {}

  void Count(const std::exception& error) noexcept {
    if (count_.fetch_add(1, std::memory_order_relaxed) > 0) return;
    spdlog::error("{} was dropped because of an exception; further ones are only counted: {}", what_, error.what());
  }
  // Does `act`. False if it threw, which is counted.
  template <typename Act>
  bool Guard(const Act& act) noexcept {
    try {
      act();
      return true;
    } catch (const std::exception& error) {
      Count(error);
      return false;
    }
  }
  [[nodiscard]] std::uint64_t count() const { return count_.load(std::memory_order_relaxed); }

 private:
  const char* const what_;
  std::atomic<std::uint64_t> count_{0};
};

}  // namespace cairn::server
