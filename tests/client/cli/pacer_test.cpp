#include "client/cli/pacer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "client/cli/sim_run.h"

namespace cairn::client {
namespace {

constexpr Stamp kStart = 1000 * kNanosPerSecond;

double SecondsUntil(Pacer& pacer, Stamp stamp, Pacer::Clock::time_point now) {
  return std::chrono::duration<double>(pacer.Due(stamp, now) - now).count();
}

TEST(Pacer, FollowsTheStampsAtItsRate) {
  Pacer pacer(4.0);
  const auto now = Pacer::Clock::now();
  EXPECT_EQ(SecondsUntil(pacer, kStart, now), 0.0);
  EXPECT_NEAR(SecondsUntil(pacer, kStart + 2 * kNanosPerSecond, now), 0.5, 1e-6);
  EXPECT_NEAR(SecondsUntil(pacer, kStart + 4 * kNanosPerSecond, now + std::chrono::seconds(1)), 0.0, 1e-6);
  EXPECT_LT(SecondsUntil(pacer, kStart + 4 * kNanosPerSecond, now + std::chrono::seconds(3)), 0.0) << "late: no wait";
}

TEST(Pacer, WithoutARateNothingWaits) {
  Pacer pacer(0.0);
  const auto now = Pacer::Clock::now();
  EXPECT_EQ(SecondsUntil(pacer, kStart, now), 0.0);
  EXPECT_EQ(SecondsUntil(pacer, kStart + 100 * kNanosPerSecond, now), 0.0);
}

TEST(Pacer, AStampThatJumpsAYearDoesNotHoldTheStreamUp) {
  Pacer pacer(1.0);
  const auto now = Pacer::Clock::now();
  (void)pacer.Due(kStart, now);
  const Stamp year_later = kStart + 365LL * 86400 * kNanosPerSecond;
  EXPECT_EQ(SecondsUntil(pacer, year_later, now), 0.0);
  EXPECT_NEAR(SecondsUntil(pacer, year_later + kNanosPerSecond, now), 1.0, 1e-6) << "it goes on from there";
  EXPECT_EQ(SecondsUntil(pacer, kStart, now), 0.0) << "and back";
}

TEST(CpuSecondsOf, GrowsForThisProcessAndKnowsNoOther) {
  const auto before = CpuSecondsOf(getpid());
  ASSERT_TRUE(before);
  std::optional<double> after = before;
  // The system counts in ticks of 10 ms, so that one step of work may pass unseen or be seen at once.
  volatile long work = 0;
  while (*after <= *before && work < 2'000'000'000) {
    for (int i = 0; i < 100'000; ++i) work = work + 1;
    after = CpuSecondsOf(getpid());
    ASSERT_TRUE(after);
  }
  EXPECT_GT(*after, *before);
  EXPECT_FALSE(CpuSecondsOf(-1));
}

}  // namespace
}  // namespace cairn::client
