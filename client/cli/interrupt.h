// Whether the user asked to stop (SIGINT, SIGTERM). Long commands look between two steps and end in order.
#pragma once

namespace cairn::client {

// From now on the signals only set the flag; a second one ends the program at once. For main() alone.
void CatchInterrupts();
[[nodiscard]] bool Interrupted();

}  // namespace cairn::client
