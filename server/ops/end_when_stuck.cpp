#include "server/ops/end_when_stuck.h"

#include <spdlog/spdlog.h>

#include <cstdlib>

namespace cairn::server {

void EndWhenStuck::Look(bool healthy, Heartbeat::Clock::time_point now) {
  if (heartbeat_.Check({{"server", {.finished = 0, .busy = !healthy}}}, now).empty()) return;
  spdlog::critical(
      "the server has not worked for more than {} s and no service manager watches it: it ends, to be started again",
      longest_unhealthy_.count());
  spdlog::shutdown();
  std::_Exit(kStuckExitCode);
}

}  // namespace cairn::server
