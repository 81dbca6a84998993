// The terminal on which `cairn top` draws: standard output, and single keys from standard input. Use it from one
// thread.
#pragma once

#include <chrono>
#include <functional>
#include <ostream>
#include <string>

#include "client/cli/top_table.h"

namespace cairn::client {

// Draws over what is on the terminal, and again whenever its size changes, until it is time. Returns false before that
// if the user wants to leave: with the key q, or as Interrupted() says. `text` makes the text for a size.
[[nodiscard]] bool DrawUntil(std::ostream& out, const std::function<std::string(const TerminalSize&)>& text,
                             std::chrono::steady_clock::time_point time);

}  // namespace cairn::client
