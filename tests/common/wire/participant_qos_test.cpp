#include "common/wire/participant_qos.h"

#include <gtest/gtest.h>

#include <bit>
#include <memory>

namespace cairn::wire {
namespace {

// A forged datagram differs in a few bits from one that was heard. It must not name a participant that joins later.
TEST(ParticipantQos, ParticipantsOfOneProcessAreNotNumbered) {
  const auto prefix = [] {
    return ParticipantQos(WireOptions{}, "test", std::make_shared<GuardReport>()).wire_protocol().prefix;
  };
  const auto first = prefix(), second = prefix();
  int different = 0;
  for (unsigned i = 0; i < first.size; ++i)
    different += std::popcount(static_cast<unsigned>(first.value[i] ^ second.value[i]));
  EXPECT_GT(different, 16);         // Of 80; 40 on the average, fewer than 17 once in ten million.
  EXPECT_EQ(first.value[0], 0x01);  // What the standard wants to stand there: the vendor.
  EXPECT_EQ(first.value[1], 0x0F);
}

}  // namespace
}  // namespace cairn::wire
