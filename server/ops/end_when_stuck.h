// The end of a server that does not work any more, where no service manager watches it. Thread rule: one thread.
#pragma once

#include "server/ops/heartbeat.h"

namespace cairn::server {

// The exit code of a server that ended itself.
inline constexpr int kStuckExitCode = 4;

class EndWhenStuck {
 public:
  explicit EndWhenStuck(std::chrono::seconds longest_unhealthy)
      : longest_unhealthy_(longest_unhealthy), heartbeat_(longest_unhealthy) {}

  // To be called again and again. Ends the process with kStuckExitCode when every call for longer than
  // `longest_unhealthy` has been told that the server is not healthy. A thread that is stuck cannot be asked to stop,
  // so nothing is closed. What was called durable is on the disk.
  void Look(bool healthy, Heartbeat::Clock::time_point now);

 private:
  const std::chrono::seconds longest_unhealthy_;
  Heartbeat heartbeat_;
};

}  // namespace cairn::server
