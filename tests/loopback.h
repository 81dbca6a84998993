// What tests over real sockets share: a domain of this process's own, and waiting on conditions with a deadline.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "common/wire/bus.h"
#include "tests/eventually.h"
#include "tests/must.h"
#include "tests/test_domain.h"

namespace cairn::test {

using wire::Bus;
using wire::WireOptions;

inline WireOptions LoopbackOptions() {
  WireOptions options;
  options.domain = TestDomain();
  return options;
}

inline std::unique_ptr<Bus> MakeBus(const std::string& name, const WireOptions& options = LoopbackOptions()) {
  return Must(Bus::Create(options, name));
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
