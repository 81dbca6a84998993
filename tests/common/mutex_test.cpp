#include "common/mutex.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace cairn {
namespace {

class Counter {
 public:
  void Add() {
    MutexLock lock(mutex_);
    ++count_;
    changed_.NotifyAll();
  }
  // False if the count is not reached in time.
  bool WaitFor(int count, std::chrono::seconds longest) {
    const auto deadline = std::chrono::steady_clock::now() + longest;
    MutexLock lock(mutex_);
    while (count_ < count) {
      if (!changed_.WaitUntil(mutex_, deadline)) return count_ >= count;
    }
    return true;
  }

 private:
  Mutex mutex_;
  CondVar changed_;
  int count_ CAIRN_GUARDED_BY(mutex_) = 0;
};

TEST(Mutex, ManyThreadsCountRight) {
  Counter counter;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < 1000; ++k) counter.Add();
    });
  }
  EXPECT_TRUE(counter.WaitFor(4000, std::chrono::seconds(60)));
  for (auto& thread : threads) thread.join();
}

TEST(CondVar, GivesUpAtTheDeadline) {
  Counter counter;
  EXPECT_FALSE(counter.WaitFor(1, std::chrono::seconds(0)));
}

TEST(Mutex, TryLockFailsWhileAnotherHoldsIt) {
  Mutex mutex;
  bool locked = false;
  const auto try_elsewhere = [&] {
    if (!mutex.TryLock()) return;
    locked = true;
    mutex.Unlock();
  };
  mutex.Lock();
  std::thread(try_elsewhere).join();
  EXPECT_FALSE(locked);
  mutex.Unlock();
  std::thread(try_elsewhere).join();
  EXPECT_TRUE(locked);
}

}  // namespace
}  // namespace cairn
