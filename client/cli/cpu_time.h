// The processor time that a process has used, read from /proc. Load tests print it for the server.
#pragma once

#include <optional>

namespace cairn::client {

// Seconds of all its threads, user and system; nothing where there is no such process.
[[nodiscard]] std::optional<double> CpuSecondsOf(int pid);

}  // namespace cairn::client
