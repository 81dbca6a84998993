// What tests over real sockets share: a domain of this process's own, and waiting on conditions with a deadline.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/wire/bus.h"

namespace cairn::test {

using wire::Bus;
using wire::WireOptions;

// 1..200, held by a file lock until the process ends, so that tests run side by side.
inline std::int64_t TestDomain() {
  static const std::int64_t domain = [] {
    for (int i = 0; i < 200; ++i) {
      const int candidate = 1 + (getpid() + i) % 200;
      const std::string path = std::filesystem::temp_directory_path() / ("cairn-domain-" + std::to_string(candidate));
      const int file = open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
      if (file >= 0 && flock(file, LOCK_EX | LOCK_NB) == 0) return candidate;
      if (file >= 0) close(file);
    }
    throw std::runtime_error("all DDS test domains are in use");
  }();
  return domain;
}

inline WireOptions LoopbackOptions() {
  WireOptions options;
  options.domain = TestDomain();
  return options;
}

inline std::unique_ptr<Bus> MakeBus(const std::string& name, const WireOptions& options = LoopbackOptions()) {
  Result<std::unique_ptr<Bus>> bus = Bus::Create(options, name);
  if (!bus) throw std::runtime_error(bus.error().message);
  return std::move(*bus);
}

inline void Must(const Result<void>& result) {
  if (!result) throw std::runtime_error(result.error().message);
}

template <typename T>
T Must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}

inline constexpr std::chrono::seconds kDeadline{20};  // Generous: sanitizers, a busy machine. Never waited for in full.

// Polls; for conditions no callback announces.
inline bool Eventually(const std::function<bool()>& condition, std::chrono::milliseconds deadline = kDeadline) {
  const auto end = std::chrono::steady_clock::now() + deadline;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    usleep(2000);
  }
  return true;
}

// Collects what a subscription receives.
template <typename Value>
class Inbox {
 public:
  std::function<void(Value&&)> Sink() {
    return [this](Value&& value) {
      const std::lock_guard lock(mutex_);
      values_.push_back(std::move(value));
      changed_.notify_all();
    };
  }
  // Waits until there are `count`, or the deadline.
  bool WaitFor(std::size_t count, std::chrono::milliseconds deadline = kDeadline) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, deadline, [&] { return values_.size() >= count; });
  }
  std::vector<Value> values() {
    const std::lock_guard lock(mutex_);
    return values_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Value> values_;
};

}  // namespace cairn::test
