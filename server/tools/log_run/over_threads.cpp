#include "server/tools/log_run/over_threads.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "common/mutex.h"

namespace cairn::server {
namespace {

// A loop is split into this many pieces per thread. If one thread starts late or is delayed, the others take
// its pieces.
constexpr int kPiecesPerThread = 4;
// Number of polls before a thread sleeps. They take about 50 us, which is longer than the pause between two
// generations of differential evolution.
constexpr int kLooks = 200;

bool Soon(const auto& is_due) {
  for (int look = 0; look < kLooks; ++look) {
    if (is_due()) return true;
    std::this_thread::yield();
  }
  return false;
}

// A pool of threads that runs one loop at a time. A caller that finds it busy runs its loop alone.
class StandingThreads {
 public:
  explicit StandingThreads(int helpers) {
    for (int i = 0; i < helpers; ++i) threads_.emplace_back([this] { Help(); });
  }
  ~StandingThreads() {
    {
      const MutexLock lock(mutex_);
      stopping_ = true;
      ++round_;
    }
    begun_.NotifyAll();
    for (std::thread& thread : threads_) thread.join();
  }
  StandingThreads(const StandingThreads&) = delete;
  StandingThreads& operator=(const StandingThreads&) = delete;

  void Run(int count, const std::function<void(int, int)>& body) {
    if (count <= 1 || busy_.exchange(true)) return slam::SerialFor(count, body);
    const int threads = static_cast<int>(threads_.size()) + 1;
    Loop loop{count, std::min(count, threads * kPiecesPerThread), &body};
    {
      const MutexLock lock(mutex_);
      loop_ = &loop;
      ++round_;
    }
    begun_.NotifyAll();
    Work(loop);
    // No further thread may join the loop. Threads that have joined it still use `loop`, so wait for them.
    {
      const MutexLock lock(mutex_);
      loop_ = nullptr;
    }
    if (!Soon([&] { return helping_.load() == 0; })) {
      const MutexLock lock(mutex_);
      while (helping_.load() != 0) left_.Wait(mutex_);
    }
    busy_ = false;
  }

 private:
  struct Loop {
    int count;
    int pieces;
    const std::function<void(int, int)>* body;
    std::atomic<int> next{0};
  };

  static int Begin(const Loop& loop, int piece) {
    return static_cast<int>(static_cast<std::int64_t>(loop.count) * piece / loop.pieces);
  }
  static void Work(Loop& loop) {
    for (int piece = loop.next++; piece < loop.pieces; piece = loop.next++)
      (*loop.body)(Begin(loop, piece), Begin(loop, piece + 1));
  }

  void Help() {
    std::uint64_t seen = 0;
    while (Loop* loop = Join(seen)) {
      Work(*loop);
      const MutexLock lock(mutex_);
      if (--helping_ == 0) left_.NotifyOne();
    }
  }
  // Waits for the next loop and joins it. Returns null when the pool ends.
  Loop* Join(std::uint64_t& seen) {
    while (true) {
      Soon([&] { return round_.load() != seen; });
      const MutexLock lock(mutex_);
      while (round_.load() == seen) begun_.Wait(mutex_);
      seen = round_.load();
      if (stopping_) return nullptr;
      if (loop_ == nullptr) continue;  // The loop has already ended.
      ++helping_;
      return loop_;
    }
  }

  std::atomic<bool> busy_{false};
  // Both are written under the mutex; polling threads read them without it.
  std::atomic<std::uint64_t> round_{0};
  std::atomic<int> helping_{0};
  Mutex mutex_;
  CondVar begun_, left_;
  Loop* loop_ CAIRN_GUARDED_BY(mutex_) = nullptr;  // The running loop while threads may join it.
  bool stopping_ CAIRN_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

}  // namespace

slam::ParallelFor OverThreads(std::int64_t threads) {
  const int count = threads > 0 ? static_cast<int>(threads) : static_cast<int>(std::thread::hardware_concurrency());
  if (count <= 1) return slam::SerialFor;
  return [pool = std::make_shared<StandingThreads>(count - 1)](int size, const std::function<void(int, int)>& body) {
    pool->Run(size, body);
  };
}

}  // namespace cairn::server
