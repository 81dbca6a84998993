// Threads for the programs that run the estimator without a server.
#pragma once

#include <cstdint>

#include "server/slam/parallel_for.h"

namespace cairn::server {

// Spreads loops over `threads` (0: one per core), the caller's among them. The threads stand ready from one loop to the
// next, and look out for it a moment before they sleep: a generation of an evolution lasts 0.1 ms. Copies share the
// threads, which end with the last copy. A loop begun while another one runs, within it or in another thread, runs in
// its caller alone. The body must not throw: on a thread of its own nobody could catch it.
[[nodiscard]] slam::ParallelFor OverThreads(std::int64_t threads);

}  // namespace cairn::server
