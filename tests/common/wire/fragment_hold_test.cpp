#include "common/wire/fragment_hold.h"

#include <gtest/gtest.h>

namespace cairn::wire {
namespace {

using Held = FragmentHold::Datagram;

// One fragment of a sample of 1,000 bytes in fragments of 400: three of them.
FragmentRange Fragment(std::int64_t sequence, std::uint32_t number, std::uint32_t count = 1) {
  return {.sample = {{}, sequence}, .first = number, .count = count, .fragment_bytes = 400, .sample_bytes = 1000};
}

std::vector<Held> Add(FragmentHold& hold, std::uint8_t name, const std::vector<FragmentRange>& fragments) {
  return hold.Add(Held(100, name), fragments);
}

std::vector<Held> Named(std::initializer_list<std::uint8_t> names) {
  std::vector<Held> datagrams;
  for (const std::uint8_t name : names) datagrams.emplace_back(100, name);
  return datagrams;
}

TEST(FragmentHold, ASampleIsDeliveredWhenItIsWhole) {
  FragmentHold hold;
  EXPECT_TRUE(Add(hold, 3, {Fragment(1, 3)}).empty());
  EXPECT_TRUE(Add(hold, 1, {Fragment(1, 1)}).empty());
  EXPECT_TRUE(Add(hold, 1, {Fragment(1, 1)}).empty());  // Again.
  EXPECT_TRUE(Add(hold, 9, {Fragment(2, 2)}).empty());  // Of another sample.
  EXPECT_EQ(Add(hold, 2, {Fragment(1, 2)}), Named({3, 1, 1, 2}));
  EXPECT_EQ(Add(hold, 4, {Fragment(2, 1), Fragment(2, 3)}), Named({9, 4}));
  EXPECT_EQ(hold.bytes(), 0U);
}

TEST(FragmentHold, AWholeSampleInOneDatagramIsNotHeld) {
  FragmentHold hold;
  EXPECT_EQ(Add(hold, 1, {Fragment(1, 1, 3)}), Named({1}));
  EXPECT_EQ(hold.bytes(), 0U);
}

TEST(FragmentHold, ADatagramWaitsForAllItsSamples) {
  FragmentHold hold;
  EXPECT_TRUE(Add(hold, 1, {Fragment(1, 1, 2)}).empty());
  // The first one is of a sample that is whole now. The second one waits for the rest of another.
  EXPECT_EQ(Add(hold, 2, {Fragment(1, 3), Fragment(2, 1)}), Named({1}));
  EXPECT_EQ(Add(hold, 3, {Fragment(2, 2, 2)}), Named({2, 3}));
}

TEST(FragmentHold, FragmentsOfAnotherSizeBeginAnotherSample) {
  FragmentHold hold;
  EXPECT_TRUE(Add(hold, 1, {Fragment(1, 1, 2)}).empty());
  FragmentRange other = Fragment(1, 1);
  other.fragment_bytes = 500;
  EXPECT_TRUE(Add(hold, 2, {other}).empty());
  EXPECT_TRUE(Add(hold, 3, {Fragment(1, 3)}).empty());
  EXPECT_EQ(Add(hold, 4, {Fragment(1, 1, 2)}), Named({3, 4}));
  // A datagram that contradicts itself completes nothing.
  EXPECT_TRUE(Add(hold, 5, {Fragment(7, 1, 3), {.sample = {{}, 7}, .count = 1, .fragment_bytes = 1, .sample_bytes = 9}})
                  .empty());
}

TEST(FragmentHold, TheOldestAreForgottenFirst) {
  FragmentHold hold;
  EXPECT_TRUE(Add(hold, 1, {Fragment(0, 1, 2)}).empty());
  for (std::int64_t sequence = 1; sequence < 20000; ++sequence) {
    EXPECT_TRUE(Add(hold, 2, {Fragment(sequence, 1, 2)}).empty());
    ASSERT_LE(hold.bytes(), FragmentHold::kMaxBytes);
  }
  EXPECT_TRUE(Add(hold, 3, {Fragment(0, 3)}).empty());
  EXPECT_EQ(Add(hold, 4, {Fragment(19999, 3)}), Named({2, 4}));
}

}  // namespace
}  // namespace cairn::wire
