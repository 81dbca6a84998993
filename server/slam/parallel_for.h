// The interface by which slam distributes independent work; the caller provides the implementation. Results
// never depend on the number of threads, because each index writes only its own output and reductions happen
// afterwards in index order.
#pragma once

#include <functional>

namespace cairn::slam {

// Calls body(begin, end) over disjoint ranges that cover [0, count), possibly in parallel; returns when all
// are done.
using ParallelFor = std::function<void(int count, const std::function<void(int begin, int end)>& body)>;

// Calls body once for the whole range, in the calling thread.
inline void SerialFor(int count, const std::function<void(int, int)>& body) {
  if (count > 0) body(0, count);
}

}  // namespace cairn::slam
