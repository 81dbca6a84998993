// A cable between two TAP devices that loses, delays and reorders Ethernet frames, or carries none, as it is told. Each
// frame has a delay of its own, so a delay that varies also reorders. The same seed and the same frames give the same
// faults. Thread-safe; the frames are carried by a thread of its own.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <queue>
#include <random>
#include <thread>
#include <vector>

#include "common/mutex.h"

namespace cairn::test {

struct LinkFaults {
  double loss = 0.0;      // Share of the frames.
  double delay_s = 0.0;   // Mean delay,
  double spread_s = 0.0;  // which varies by at most this, uniformly.
  bool cut = false;       // Nothing passes, nor what was on its way.
};

class FaultyLink {
 public:
  // The descriptors of the two devices; they outlive the link.
  FaultyLink(int a, int b, std::uint64_t seed);
  ~FaultyLink();
  FaultyLink(const FaultyLink&) = delete;
  FaultyLink& operator=(const FaultyLink&) = delete;

  void Set(const LinkFaults& faults);
  [[nodiscard]] std::uint64_t carried() const { return carried_; }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Frame {
    Clock::time_point due;
    std::uint64_t number = 0;  // Frames of the same moment keep their order.
    int to = -1;
    std::vector<char> bytes;
    bool operator<(const Frame& other) const { return due != other.due ? due > other.due : number > other.number; }
  };

  void Carry();
  void Take(int from, int to, const LinkFaults& faults);
  void Deliver(const LinkFaults& faults);
  [[nodiscard]] int MillisecondsUntilNext() const;
  [[nodiscard]] LinkFaults faults();

  const int a_, b_;
  std::mt19937_64 random_;              // This and the frames are the thread's.
  std::priority_queue<Frame> waiting_;  // Soonest first.
  std::uint64_t taken_ = 0;
  std::atomic<std::uint64_t> carried_ = 0, lost_ = 0;
  std::atomic<bool> stop_ = false;
  Mutex mutex_;
  LinkFaults faults_ CAIRN_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace cairn::test
