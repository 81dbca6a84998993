#include "common/wire/receive_watch.h"

#include <gtest/gtest.h>

#include <optional>

namespace cairn::wire {
namespace {

TEST(ReceiveWatch, TellsOfTheLongestDeliveryUnderWay) {
  ReceiveWatch watch;
  const auto in_a_minute = [] { return ReceiveWatch::Clock::now() + std::chrono::minutes(1); };
  EXPECT_EQ(watch.Longest(in_a_minute()), ReceiveWatch::Clock::duration::zero());
  const auto before_both = ReceiveWatch::Clock::now();
  std::optional<ReceiveWatch::Delivery> first(std::in_place, watch);
  const auto between = ReceiveWatch::Clock::now();
  {
    // Of another thread, while the first one is still under way.
    const ReceiveWatch::Delivery second(watch);
    const auto now = in_a_minute();
    EXPECT_GE(watch.Longest(now), now - between);
    EXPECT_LE(watch.Longest(now), now - before_both);
  }
  const auto now = in_a_minute();
  EXPECT_GE(watch.Longest(now), now - between);
  first.reset();
  EXPECT_EQ(watch.Longest(in_a_minute()), ReceiveWatch::Clock::duration::zero());
}

}  // namespace
}  // namespace cairn::wire
