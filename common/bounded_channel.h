// A queue between threads that holds at most `capacity` values: any number of senders and receivers, values leave in
// the order they came. Overflow rule: a full channel refuses (TryPush), the sender decides what that means; Push waits.
// After Close nothing more comes in, what is inside still goes out. Thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <stop_token>
#include <utility>

#include "common/mutex.h"

namespace cairn {

template <typename T>
class BoundedChannel {
 public:
  // `capacity` must be at least 1.
  explicit BoundedChannel(std::size_t capacity) : capacity_(capacity) {}
  BoundedChannel(const BoundedChannel&) = delete;
  BoundedChannel& operator=(const BoundedChannel&) = delete;

  // False if the channel is full or closed: `value` is then untouched.
  [[nodiscard]] bool TryPush(T&& value) CAIRN_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return PushLocked(std::move(value));
  }
  [[nodiscard]] bool TryPush(const T& value) CAIRN_EXCLUDES(mutex_) { return TryPush(T(value)); }

  // Waits for room. False if the channel is or becomes closed, or a stop is requested.
  [[nodiscard]] bool Push(T value, std::stop_token stop = {}) CAIRN_EXCLUDES(mutex_) {
    const std::stop_callback wake(stop, [this] { Wake(); });
    MutexLock lock(mutex_);
    while (values_.size() >= capacity_ && !closed_ && !stop.stop_requested()) room_.Wait(mutex_);
    return !stop.stop_requested() && PushLocked(std::move(value));
  }

  // Waits for a value. Nothing if the channel is closed and empty, or a stop is requested (values may remain).
  [[nodiscard]] std::optional<T> Pop(std::stop_token stop = {}) CAIRN_EXCLUDES(mutex_) {
    const std::stop_callback wake(stop, [this] { Wake(); });
    MutexLock lock(mutex_);
    while (values_.empty() && !closed_ && !stop.stop_requested()) filled_.Wait(mutex_);
    if (stop.stop_requested()) return std::nullopt;
    return PopLocked();
  }

  // Like Pop, but waits at most this long.
  template <typename Rep, typename Period>
  [[nodiscard]] std::optional<T> PopFor(const std::chrono::duration<Rep, Period>& duration) CAIRN_EXCLUDES(mutex_) {
    const auto deadline = std::chrono::steady_clock::now() + duration;
    MutexLock lock(mutex_);
    while (values_.empty() && !closed_ && filled_.WaitUntil(mutex_, deadline)) {
    }
    return PopLocked();
  }

  [[nodiscard]] std::optional<T> TryPop() CAIRN_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return PopLocked();
  }

  // Wakes everybody who waits. May be called again.
  void Close() CAIRN_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    closed_ = true;
    filled_.NotifyAll();
    room_.NotifyAll();
  }

  [[nodiscard]] bool closed() const CAIRN_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return closed_;
  }
  [[nodiscard]] std::size_t size() const CAIRN_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return values_.size();
  }
  // How many values have left the channel so far: shows that its receivers move.
  [[nodiscard]] std::uint64_t taken() const CAIRN_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return taken_;
  }
  [[nodiscard]] std::size_t capacity() const { return capacity_; }

 private:
  bool PushLocked(T&& value) CAIRN_REQUIRES(mutex_) {
    if (closed_ || values_.size() >= capacity_) return false;
    values_.push_back(std::move(value));
    filled_.NotifyOne();
    return true;
  }

  std::optional<T> PopLocked() CAIRN_REQUIRES(mutex_) {
    if (values_.empty()) return std::nullopt;
    std::optional<T> value(std::move(values_.front()));
    values_.pop_front();
    ++taken_;
    room_.NotifyOne();
    return value;
  }

  // Under the mutex, so that a stop cannot slip in between a waiter's check and its wait.
  void Wake() CAIRN_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    filled_.NotifyAll();
    room_.NotifyAll();
  }

  const std::size_t capacity_;
  mutable Mutex mutex_;
  CondVar filled_;
  CondVar room_;
  std::deque<T> values_ CAIRN_GUARDED_BY(mutex_);
  std::uint64_t taken_ CAIRN_GUARDED_BY(mutex_) = 0;
  bool closed_ CAIRN_GUARDED_BY(mutex_) = false;
};

}  // namespace cairn
