// Processor time a process has used, from /proc: what a load test prints as the server's share.
#pragma once

#include <optional>

namespace cairn::client {

// Seconds of all its threads, user and system; nothing where there is no such process.
[[nodiscard]] std::optional<double> CpuSecondsOf(int pid);

}  // namespace cairn::client
