#include "server/door_losses.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

using std::chrono::seconds;

TEST(DoorLosses, SaysNothingWhileNothingIsLost) {
  DoorLosses losses;
  EXPECT_FALSE(losses.Check({}, DoorLosses::Clock::time_point{}));
  EXPECT_EQ(TextOf({}), "nothing");
}

// The losses used to be logged only once, when the server ended.
TEST(DoorLosses, SaysSoWhenLossesBeginAndThenAtABoundedRate) {
  DoorLosses losses;
  const DoorLosses::Clock::time_point start{};
  EXPECT_EQ(losses.Check({.inbound_full = 2}, start),
            "messages lost between DDS and the server: 2 received (inbound channel full); since the start: 2 received "
            "(inbound channel full)");
  int lines = 0;
  DoorCounts counts{.inbound_full = 2};
  for (int second = 1; second <= 60; ++second) {
    counts.inbound_full += 5;
    ++counts.malformed;
    const auto line = losses.Check(counts, start + seconds(second));
    if (!line) continue;
    ++lines;
    if (lines == 1) {
      EXPECT_EQ(*line,
                "messages lost between DDS and the server: 50 received (inbound channel full), 10 malformed; since the "
                "start: 52 received (inbound channel full), 10 malformed");
    }
  }
  EXPECT_EQ(lines, 6);
  // Losses since the last line are reported when the period has passed, even if nothing more is lost.
  ++counts.unpublished;
  EXPECT_FALSE(losses.Check(counts, start + seconds(61)));
  EXPECT_TRUE(losses.Check(counts, start + seconds(70)));
  EXPECT_FALSE(losses.Check(counts, start + seconds(90)));
}

TEST(DoorLosses, NamesEachKind) {
  EXPECT_EQ(TextOf({.inbound_full = 1, .malformed = 2, .uncounted_scans = 3, .outbound_full = 4, .unpublished = 5}),
            "1 received (inbound channel full), 2 malformed, 3 scans of too many unknown streams, 4 to send (outbound "
            "lane full), 5 not accepted by DDS in time");
}

}  // namespace
}  // namespace cairn::server
