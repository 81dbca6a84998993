// Tells whether the server's threads make progress. Each strand and channel reports how many pieces of work
// it has finished and whether any wait. One that has work and finishes nothing for longer than the limit is
// stalled; the server then stops notifying the systemd watchdog, and is restarted. An overloaded server still
// finishes work, so it is slow but not stalled, and a restart would not help. Latencies are measured in the
// ledgers, not here. Thread rule: one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace cairn::server {

// What a strand or a channel reports.
struct Pulse {
  std::uint64_t finished = 0;  // Pieces of work finished so far.
  bool busy = false;           // Work is under way or waits.
};

class Heartbeat {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Heartbeat(Clock::duration limit) : limit_(limit) {}

  // Returns the names of the stalled ones at `now`. Names that are missing in this call are forgotten.
  std::vector<std::string> Check(const std::map<std::string, Pulse>& pulses, Clock::time_point now);

 private:
  struct Beat {
    std::uint64_t finished = 0;
    Clock::time_point moved;  // The last time it was idle or had finished more work.
  };
  const Clock::duration limit_;
  std::map<std::string, Beat> beats_;
};

}  // namespace cairn::server
