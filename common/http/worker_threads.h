// The threads of an HTTP server, one for each connection: made when they are needed, up to a bound. Overflow rule:
// enqueue waits until a thread is free, so that new connections wait in the system's queue; meanwhile `crowded` is
// true, and connections that are only kept open should end. Thread-safe.
#pragma once

#include <httplib.h>

#include <atomic>
#include <functional>
#include <list>
#include <optional>
#include <thread>
#include <vector>

#include "common/mutex.h"

namespace cairn {

class WorkerThreads final : public httplib::TaskQueue {
 public:
  // `crowded` outlives it.
  WorkerThreads(int most, std::atomic<bool>& crowded) : most_(static_cast<std::size_t>(most)), crowded_(crowded) {}

  void enqueue(std::function<void()> task) override;
  // Returns when all tasks have ended.
  void shutdown() override;

 private:
  void Run();
  [[nodiscard]] std::optional<std::function<void()>> Next();

  const std::size_t most_;
  std::atomic<bool>& crowded_;
  Mutex mutex_;
  CondVar changed_;
  bool ending_ CAIRN_GUARDED_BY(mutex_) = false;
  std::size_t busy_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::list<std::function<void()>> waiting_ CAIRN_GUARDED_BY(mutex_);
  std::vector<std::thread> threads_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn
