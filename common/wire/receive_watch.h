// Tells for how long the middleware has been busy with one datagram. It takes microseconds; a datagram that makes it
// work for minutes holds up all that would arrive after it, and no answer to anybody would say so. Thread-safe.
#pragma once

#include <algorithm>
#include <chrono>
#include <vector>

#include "common/mutex.h"

namespace cairn::wire {

class ReceiveWatch {
 public:
  using Clock = std::chrono::steady_clock;

  // Exists while one datagram is with the middleware.
  class Delivery {
   public:
    explicit Delivery(ReceiveWatch& watch) : watch_(watch) { watch_.Begin(begun_); }
    Delivery(const Delivery&) = delete;
    Delivery& operator=(const Delivery&) = delete;
    ~Delivery() { watch_.End(begun_); }

   private:
    ReceiveWatch& watch_;
    const Clock::time_point begun_ = Clock::now();
  };

  // Of the deliveries under way the longest; zero where there is none.
  [[nodiscard]] Clock::duration Longest(Clock::time_point now) const {
    const MutexLock lock(mutex_);
    if (begun_.empty()) return Clock::duration::zero();
    return std::max(Clock::duration::zero(), now - *std::min_element(begun_.begin(), begun_.end()));
  }

 private:
  void Begin(Clock::time_point at) {
    const MutexLock lock(mutex_);
    begun_.push_back(at);
  }
  void End(Clock::time_point at) {
    const MutexLock lock(mutex_);
    begun_.erase(std::find(begun_.begin(), begun_.end(), at));
  }

  mutable Mutex mutex_;
  std::vector<Clock::time_point> begun_ CAIRN_GUARDED_BY(mutex_);  // One for each receiving thread at most.
};

}  // namespace cairn::wire
