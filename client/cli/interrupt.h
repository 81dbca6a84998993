// Whether the user asked to stop (SIGINT, SIGTERM). Long commands check it between two steps and then end in an orderly
// way.
#pragma once

#include <chrono>

namespace cairn::client {

// From now on the first signal only sets the flag, and a second one ends the program at once. Only main() calls this.
void CatchInterrupts();
[[nodiscard]] bool Interrupted();
// Returns at this time, or soon after the user asked to stop.
void WaitUntil(std::chrono::steady_clock::time_point time);

}  // namespace cairn::client
