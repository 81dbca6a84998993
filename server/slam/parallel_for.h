// How slam spreads independent work: the caller hands in the means. Results never depend on the thread count because
// each index writes only its own output and reductions happen afterwards in index order.
#pragma once

#include <functional>

namespace cairn::slam {

// Calls body(begin, end) over disjoint ranges that cover [0, count), possibly in parallel; returns when all are done.
using ParallelFor = std::function<void(int count, const std::function<void(int begin, int end)>& body)>;

// One range, in the calling thread.
inline void SerialFor(int count, const std::function<void(int, int)>& body) {
  if (count > 0) body(0, count);
}

}  // namespace cairn::slam
