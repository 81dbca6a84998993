#include "common/http/worker_threads.h"

#include <utility>

namespace cairn {

void WorkerThreads::enqueue(std::function<void()> task) {
  const MutexLock lock(mutex_);
  while (busy_ + waiting_.size() >= most_ && !ending_) {
    crowded_ = true;
    changed_.Wait(mutex_);
  }
  crowded_ = false;
  waiting_.push_back(std::move(task));
  if (busy_ + waiting_.size() > threads_.size()) threads_.emplace_back([this] { Run(); });
  changed_.NotifyAll();
}

std::optional<std::function<void()>> WorkerThreads::Next() {
  const MutexLock lock(mutex_);
  while (waiting_.empty() && !ending_) changed_.Wait(mutex_);
  if (waiting_.empty()) return std::nullopt;
  std::function<void()> task = std::move(waiting_.front());
  waiting_.pop_front();
  ++busy_;
  return task;
}

void WorkerThreads::Run() {
  while (const auto task = Next()) {
    (*task)();
    const MutexLock lock(mutex_);
    --busy_;
    changed_.NotifyAll();
  }
}

void WorkerThreads::shutdown() {
  std::vector<std::thread> threads;
  {
    const MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
    threads = std::move(threads_);
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace cairn
