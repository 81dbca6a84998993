#include "server/offline/over_threads.h"

#include <algorithm>
#include <thread>
#include <vector>

namespace cairn::server {

slam::ParallelFor OverThreads(std::int64_t threads) {
  const int count = threads > 0 ? static_cast<int>(threads) : static_cast<int>(std::thread::hardware_concurrency());
  if (count <= 1) return slam::SerialFor;
  return [count](int size, const std::function<void(int, int)>& body) {
    const int blocks = std::min(count, size);
    std::vector<std::thread> workers;
    for (int block = 1; block < blocks; ++block)
      workers.emplace_back([&, block] { body(size * block / blocks, size * (block + 1) / blocks); });
    if (blocks > 0) body(0, size / blocks);
    for (std::thread& worker : workers) worker.join();
  };
}

}  // namespace cairn::server
