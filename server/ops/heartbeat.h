// Tells whether the strands move: each is asked for a sign of life, and asked again once it has answered. One that has
// not answered for longer than the limit is stalled, and the service manager's watchdog is then left unfed.
// Not a metric: how long answers take is the ledgers' business.
// Thread rule: Check from one thread; answers come from any.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace cairn::server {

class Heartbeat {
 public:
  using Clock = std::chrono::steady_clock;
  // Makes the strand call the answer once; false where the strand takes nothing just now.
  using Ask = std::function<bool(std::function<void()> answer)>;

  explicit Heartbeat(Clock::duration limit) : limit_(limit) {}

  // The names of those that are stalled at `now`. Strands no longer named are forgotten.
  std::vector<std::string> Check(const std::map<std::string, Ask>& strands, Clock::time_point now);

 private:
  struct Beat {
    std::shared_ptr<std::atomic<bool>> answered;
    Clock::time_point asked;
  };
  const Clock::duration limit_;
  std::map<std::string, Beat> beats_;
};

}  // namespace cairn::server
