// Threads for the programs that run the estimator without a server.
#pragma once

#include <cstdint>

#include "server/slam/parallel_for.h"

namespace cairn::server {

// Spreads a loop over `threads` (0: one per core) in equal blocks; starting them costs some 20 us, which the loops
// handed to it outweigh.
[[nodiscard]] slam::ParallelFor OverThreads(std::int64_t threads);

}  // namespace cairn::server
