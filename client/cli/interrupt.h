// Whether the user asked to stop (SIGINT, SIGTERM). Long commands check it between two steps and then end in an orderly
// way.
#pragma once

namespace cairn::client {

// From now on the first signal only sets the flag, and a second one ends the program at once. Only main() calls this.
void CatchInterrupts();
[[nodiscard]] bool Interrupted();

}  // namespace cairn::client
