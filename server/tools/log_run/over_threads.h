// Parallel loops for the programs that run the estimator without a server.
#pragma once

#include <cstdint>

#include "server/slam/parallel_for.h"

namespace cairn::server {

// Distributes the iterations of a loop over `threads` threads (0: one per core), including the caller's. The
// threads are kept from one loop to the next. They poll for a short time before they sleep, because some
// loops follow each other quickly (one generation of differential evolution takes 0.1 ms). Copies share the
// threads, which end with the last copy. A loop that is started while another one runs, nested or from
// another thread, runs on its caller's thread only. The body must not throw, because nothing catches
// exceptions on the other threads.
[[nodiscard]] slam::ParallelFor OverThreads(std::int64_t threads);

}  // namespace cairn::server
