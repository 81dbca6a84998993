#include "server/tools/log_run/over_threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace cairn::server {
namespace {

// How often each index was worked on.
std::vector<int> Visits(const slam::ParallelFor& parallel_for, int count) {
  std::vector<int> visits(static_cast<std::size_t>(count), 0);
  parallel_for(count, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) ++visits[static_cast<std::size_t>(i)];
  });
  return visits;
}

TEST(OverThreads, WorksOnEveryIndexOnce) {
  for (const int threads : {1, 2, 3, 8}) {
    const slam::ParallelFor parallel_for = OverThreads(threads);
    for (const int count : {0, 1, 2, 3, 7, 100, 1000})
      EXPECT_EQ(Visits(parallel_for, count), std::vector<int>(static_cast<std::size_t>(count), 1))
          << threads << ' ' << count;
  }
}

TEST(OverThreads, AreReadyForOneLoopAfterTheOther) {
  const slam::ParallelFor parallel_for = OverThreads(3);
  for (int round = 0; round < 2000; ++round) ASSERT_EQ(Visits(parallel_for, 10), std::vector<int>(10, 1)) << round;
}

// Two pieces that each wait for the other are in two threads.
TEST(OverThreads, TwoWorkAtTheSameTime) {
  const slam::ParallelFor parallel_for = OverThreads(2);
  std::atomic<int> arrived{0};
  parallel_for(2, [&](int begin, int end) {
    ASSERT_EQ(end, begin + 1);
    ++arrived;
    while (arrived < 2) std::this_thread::yield();
  });
  EXPECT_EQ(arrived, 2);
}

TEST(OverThreads, ALoopWithinALoopIsDoneToo) {
  const slam::ParallelFor parallel_for = OverThreads(2);
  std::atomic<int> total{0};
  parallel_for(8, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) parallel_for(5, [&](int first, int last) { total += last - first; });
  });
  EXPECT_EQ(total, 40);
}

TEST(OverThreads, TwoThreadsMayShareThem) {
  const slam::ParallelFor parallel_for = OverThreads(2);
  const auto many = [&parallel_for] {
    for (int round = 0; round < 500; ++round) ASSERT_EQ(Visits(parallel_for, 20), std::vector<int>(20, 1));
  };
  std::thread other(many);
  many();
  other.join();
}

TEST(OverThreads, ACopyKeepsTheThreads) {
  slam::ParallelFor copy;
  {
    const slam::ParallelFor parallel_for = OverThreads(2);
    copy = parallel_for;
  }
  EXPECT_EQ(Visits(copy, 9), std::vector<int>(9, 1));
}

}  // namespace
}  // namespace cairn::server
