#include "server/robots/stream_ledger.h"

#include <gtest/gtest.h>

#include <iterator>
#include <random>
#include <set>
#include <string>

#include "server/slam/state/archive.h"

namespace cairn::server {
namespace {

std::uint64_t Lost(const StreamLedger& ledger) {
  return ledger.ledger().dropped[static_cast<std::size_t>(DropReason::kLostOnWire)];
}

TEST(StreamLedger, SettledThroughWaitsForTheOldestScan) {
  StreamLedger ledger{Ledger{}};
  for (std::uint64_t n = 1; n <= 4; ++n) EXPECT_TRUE(ledger.Received(n));
  ledger.Used(2, 20, true, 1.0);
  EXPECT_EQ(ledger.ledger().settled_through, 0U);
  ledger.Dropped(1, DropReason::kNoOdometry);
  EXPECT_EQ(ledger.ledger().settled_through, 2U);
  EXPECT_EQ(ledger.ledger().waiting, 2U);
  EXPECT_EQ(ledger.ledger().keyframes, 1U);
}

TEST(StreamLedger, AGapSettlesAtOnceAsLost) {
  StreamLedger ledger{Ledger{}};
  EXPECT_TRUE(ledger.Received(1));
  ledger.Used(1, 1, false, 1.0);
  EXPECT_TRUE(ledger.Received(5));
  EXPECT_EQ(Lost(ledger), 3U);
  ledger.Used(5, 2, false, 1.0);
  EXPECT_EQ(ledger.ledger().settled_through, 5U);
}

// After a restart of the server, 165 of a robot's 237 scans were counted as lost on the wire: those the server had used
// before it was stopped.
TEST(StreamLedger, WhatWasSentBeforeTheFirstNumberIsNotLost) {
  StreamLedger ledger{Ledger{}};
  EXPECT_TRUE(ledger.Received(166));
  EXPECT_EQ(Lost(ledger), 0U);
  EXPECT_EQ(ledger.ledger().settled_through, 165U);
  EXPECT_TRUE(ledger.Received(168));
  EXPECT_EQ(Lost(ledger), 1U);
  // The client sends again what it does not know to be settled.
  EXPECT_TRUE(ledger.Received(164));
  EXPECT_TRUE(ledger.Received(165));
  EXPECT_FALSE(ledger.Received(165));
  EXPECT_FALSE(ledger.Received(166));
  EXPECT_EQ(Lost(ledger), 1U);
  EXPECT_TRUE(ledger.Received(167));
  EXPECT_EQ(Lost(ledger), 0U);
  EXPECT_EQ(ledger.ledger().received, 5U);
}

TEST(StreamLedger, ALateArrivalTakesItsNumberBackFromTheLost) {
  StreamLedger ledger{Ledger{}};
  EXPECT_TRUE(ledger.Received(1));
  EXPECT_TRUE(ledger.Received(6));
  EXPECT_TRUE(ledger.Received(4));
  EXPECT_EQ(Lost(ledger), 3U);
  EXPECT_FALSE(ledger.Received(4));
  EXPECT_TRUE(ledger.Received(2));
  EXPECT_TRUE(ledger.Received(3));
  EXPECT_TRUE(ledger.Received(5));
  EXPECT_EQ(Lost(ledger), 0U);
  EXPECT_EQ(ledger.ledger().received, 6U);
}

TEST(StreamLedger, ADuplicateNumberLeavesNoTrace) {
  StreamLedger ledger{Ledger{}};
  EXPECT_TRUE(ledger.Received(1));
  EXPECT_FALSE(ledger.Received(1));
  ledger.Used(1, 1, false, 1.0);
  EXPECT_FALSE(ledger.Received(1));
  EXPECT_EQ(ledger.ledger().received, 1U);
  EXPECT_EQ(ledger.ledger().waiting, 0U);
}

TEST(StreamLedger, UnnumberedScansAreCountedEachTime) {
  StreamLedger ledger{Ledger{}};
  EXPECT_TRUE(ledger.Received(0));
  EXPECT_TRUE(ledger.Received(0));
  ledger.Used(0, 1, false, 1.0);
  EXPECT_EQ(ledger.ledger().received, 2U);
  EXPECT_EQ(ledger.ledger().waiting, 1U);
}

TEST(StreamLedger, ANewClientMayNumberFromOneAgain) {
  StreamLedger ledger{Ledger{}};
  for (std::uint64_t n = 1; n <= 10; ++n) {
    EXPECT_TRUE(ledger.Received(n));
    ledger.Used(n, 1, false, 1.0);
  }
  ledger.NewClient();
  EXPECT_TRUE(ledger.Received(2));
  EXPECT_EQ(Lost(ledger), 0U);
  ledger.Used(2, 1, false, 1.0);
  EXPECT_EQ(ledger.ledger().settled_through, 2U);
  EXPECT_EQ(ledger.ledger().used, 11U);
  EXPECT_TRUE(ledger.Received(4));
  EXPECT_EQ(Lost(ledger), 1U);
}

TEST(StreamLedger, ANewClientMayGoOnWithTheNumbers) {
  StreamLedger ledger{Ledger{}};
  EXPECT_TRUE(ledger.Received(1));
  ledger.NewClient();
  EXPECT_TRUE(ledger.Received(2));
  EXPECT_EQ(Lost(ledger), 0U);
}

TEST(StreamLedger, AnAbsurdNumberStartsAnewInsteadOfLosingMillions) {
  StreamLedger ledger{Ledger{}};
  EXPECT_TRUE(ledger.Received(1));
  EXPECT_TRUE(ledger.Received(UINT64_MAX));
  EXPECT_EQ(Lost(ledger), 0U);
  EXPECT_FALSE(ledger.Received(UINT64_MAX));
}

// One damaged sample of the odometry had settled four thousand million numbers: the robot's client sent nothing again
// that was lost, and its scans waited for this odometry for ever.
TEST(StreamLedger, ANumberFarAheadIsDoubtfulUntilAnotherFollowsIt) {
  StreamLedger ledger{Ledger{}};
  EXPECT_FALSE(ledger.IsDoubtful(7)) << "the first number of a client";
  EXPECT_TRUE(ledger.Received(7));
  const std::uint64_t far = std::uint64_t{1} << 32;
  EXPECT_FALSE(ledger.IsDoubtful(7 + StreamLedger::kBelievedStep));
  EXPECT_TRUE(ledger.IsDoubtful(8 + StreamLedger::kBelievedStep));
  EXPECT_TRUE(ledger.IsDoubtful(far)) << "it does not follow the doubtful one";
  EXPECT_FALSE(ledger.IsDoubtful(8));
  EXPECT_TRUE(ledger.IsDoubtful(far + 1)) << "the stream has gone on in between";
  EXPECT_TRUE(ledger.IsDoubtful(far - 1)) << "one that goes back";
  EXPECT_FALSE(ledger.IsDoubtful(far + 2));
  EXPECT_EQ(ledger.ledger().last_sequence, 7U);
  EXPECT_EQ(ledger.ledger().received, 1U);
}

TEST(StreamLedger, PercentilesAreOfTheLastLatencies) {
  StreamLedger ledger{Ledger{}};
  for (std::uint64_t n = 1; n <= 100; ++n) {
    EXPECT_TRUE(ledger.Received(n));
    ledger.Used(n, 1, false, static_cast<double>(n));
  }
  EXPECT_NEAR(ledger.ledger().latency_p50_ms, 50.0, 1.0);
  EXPECT_NEAR(ledger.ledger().latency_p99_ms, 99.0, 1.0);
}

// Property: the numbers that a checkpoint leaves out can come again, and then the account is as if nothing had been
// saved: the same counts, and settled_through of the same waiting numbers.
TEST(StreamLedger, WhatTheJournalDoesNotHoldIsTakenBackAndComesAgain) {
  std::mt19937 random(6);
  int saved = 0;
  for (int run = 0; run < 500; ++run) {
    StreamLedger whole{Ledger{}};
    std::set<std::uint64_t> waiting;
    std::uint64_t last = random() % 5;
    for (int i = 0; i < 40; ++i) {
      last += random() % 4 == 0 ? 1 + random() % 3 : 1;
      EXPECT_TRUE(whole.Received(last));
      waiting.insert(last);
      if (waiting.size() < 10 || random() % 2 == 0) continue;
      whole.Used(*waiting.begin(), 1, false, 1.0);
      waiting.erase(waiting.begin());
    }
    // The estimator holds the first ones, the queue the others.
    std::set<std::uint64_t> taken = waiting;
    while (!taken.empty() && random() % 5 != 0) taken.erase(std::prev(taken.end()));
    const auto account = whole.AsJournaled(taken);
    if (!account) continue;
    ++saved;
    StreamLedger again = *account;
    const Ledger before = again.ledger();
    ASSERT_EQ(before.received + Lost(again), before.used + before.dropped_total() + before.waiting);
    ASSERT_EQ(before.waiting, taken.size());
    for (const std::uint64_t number : waiting) ASSERT_EQ(again.Received(number), !taken.contains(number)) << number;
    ASSERT_EQ(again.ledger().received, whole.ledger().received);
    ASSERT_EQ(Lost(again), Lost(whole));
    ASSERT_EQ(again.ledger().last_sequence, whole.ledger().last_sequence);
    for (const std::uint64_t number : waiting) {
      again.Used(number, 1, false, 1.0);
      whole.Used(number, 1, false, 1.0);
      ASSERT_EQ(again.ledger().settled_through, whole.ledger().settled_through);
    }
  }
  EXPECT_GT(saved, 450);
}

// After so many lasting gaps a checkpoint was refused whenever a sample waited, which is nearly always.
TEST(StreamLedger, IsJournaledAlsoWhereItHasAsManyGapsAsItMayHave) {
  StreamLedger ledger{Ledger{}};
  for (std::uint64_t n = 1; n < 4000; n += 2) {
    EXPECT_TRUE(ledger.Received(n));
    ledger.Used(n, 1, false, 1.0);
  }
  EXPECT_TRUE(ledger.Received(4000));
  const auto account = ledger.AsJournaled({});
  ASSERT_TRUE(account);
  EXPECT_EQ(account->ledger().waiting, 0U);
  EXPECT_EQ(account->ledger().last_sequence, 3999U);
}

// A late number splits a gap in two. With one gap too many, the next server refused the checkpoint.
TEST(StreamLedger, HasNeverMoreGapsThanItMayHave) {
  StreamLedger ledger{Ledger{}};
  const auto take = [&ledger](std::uint64_t number) {
    EXPECT_TRUE(ledger.Received(number));
    ledger.Used(number, 1, false, 1.0);
  };
  for (std::uint64_t n = 1; n <= 4 * StreamLedger::kMaxGaps + 1; n += 4) take(n);
  for (std::uint64_t n = 403; n < 4000; n += 4) take(n);
  slam::StateWriter writer;
  writer(ledger);
  const std::string bytes = writer.Bytes();
  slam::StateReader reader(bytes);
  StreamLedger read{Ledger{}};
  reader(read);
  EXPECT_TRUE(reader.done()) << reader.failed();
  EXPECT_FALSE(read.Received(3));  // Forgotten: lost for good.
  EXPECT_TRUE(read.Received(4000));
}

// Property: whatever arrives in whatever order, no scan vanishes and settled_through never goes back.
TEST(StreamLedger, MissingNumbersAreDurableOnlyTogetherWithALaterOne) {
  StreamLedger ledger{Ledger{}};
  ledger.SetStored(true);
  for (const std::uint64_t n : {1, 2, 6, 9}) EXPECT_TRUE(ledger.Received(n));
  ledger.Durable(1);
  EXPECT_EQ(ledger.ledger().durable_through, 1U);
  // A server that starts again now knows nothing of 6, and waits for 3.
  ledger.Durable(2);
  EXPECT_EQ(ledger.ledger().durable_through, 2U);
  ledger.Durable(6);
  EXPECT_EQ(ledger.ledger().durable_through, 6U);
  EXPECT_TRUE(ledger.Received(7));
  ledger.Durable(9);
  EXPECT_EQ(ledger.ledger().durable_through, 6U);
  ledger.Durable(7);
  EXPECT_EQ(ledger.ledger().durable_through, 9U);
}

TEST(StreamLedger, TheEquationHoldsUnderRandomTraffic) {
  std::mt19937 random(5);
  for (int run = 0; run < 50; ++run) {
    StreamLedger ledger{Ledger{}};
    std::vector<std::uint64_t> waiting;
    std::uint64_t settled_before = 0;
    for (int i = 0; i < 2000; ++i) {
      if (waiting.empty() || random() % 2 == 0) {
        const std::uint64_t last = ledger.ledger().last_sequence;
        const std::uint64_t number = random() % 4 == 0 ? random() % (last + 1) : last + 1 + random() % 3;
        if (ledger.Received(number)) waiting.push_back(number);
      } else {
        const std::size_t at = random() % waiting.size();
        if (random() % 2 == 0) {
          ledger.Used(waiting[at], 1, false, 1.0);
        } else {
          ledger.Dropped(waiting[at], DropReason::kQueueFull);
        }
        waiting.erase(waiting.begin() + static_cast<std::ptrdiff_t>(at));
      }
      const Ledger now = ledger.ledger();
      ASSERT_EQ(now.received + Lost(ledger), now.used + now.dropped_total() + now.waiting);
      ASSERT_EQ(now.waiting, waiting.size());
      ASSERT_GE(now.settled_through, settled_before);
      settled_before = now.settled_through;
    }
  }
}

}  // namespace
}  // namespace cairn::server
