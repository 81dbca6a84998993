#include "server/offline/over_threads.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "common/mutex.h"

namespace cairn::server {
namespace {

// Pieces per thread: who starts late, or is held up, leaves his to the others.
constexpr int kPiecesPerThread = 4;
// Looks at what is awaited before sleeping, some 50 us: longer than from one generation of an evolution to the next.
constexpr int kLooks = 200;

bool Soon(const auto& is_due) {
  for (int look = 0; look < kLooks; ++look) {
    if (is_due()) return true;
    std::this_thread::yield();
  }
  return false;
}

// One loop at a time; whoever calls while it is busy works alone.
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
    // Nobody joins any more; who is in it still looks at `loop`.
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
  // The next loop, as one who helps in it; null at the end.
  Loop* Join(std::uint64_t& seen) {
    while (true) {
      Soon([&] { return round_.load() != seen; });
      const MutexLock lock(mutex_);
      while (round_.load() == seen) begun_.Wait(mutex_);
      seen = round_.load();
      if (stopping_) return nullptr;
      if (loop_ == nullptr) continue;  // Over already.
      ++helping_;
      return loop_;
    }
  }

  std::atomic<bool> busy_{false};
  std::atomic<std::uint64_t> round_{0};  // Written under the mutex, as the next; read without it by those who look out.
  std::atomic<int> helping_{0};
  Mutex mutex_;
  CondVar begun_, left_;
  Loop* loop_ CAIRN_GUARDED_BY(mutex_) = nullptr;  // Under way and open to helpers.
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
