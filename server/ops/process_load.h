// What this process needs of the machine. Thread rule: any thread.
#pragma once

#include <cstdint>

namespace cairn::server {

// Processor time of all threads of this process, in seconds.
[[nodiscard]] double ProcessorSeconds();
// Memory of this process that is in RAM; 0 where the system does not tell.
[[nodiscard]] std::uint64_t ResidentBytes();

}  // namespace cairn::server
