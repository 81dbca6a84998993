#include "server/slam/scan/odometry_pairing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

namespace cairn::slam {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

struct Pairing {
  explicit Pairing(const PairingOptions& options = {})
      : pairing(options, {[this](PairedScan&& p) {
                            pairs.push_back({p.scan->stamp, p.T_odom_robot});
                            grows &= pairs.size() == 1 || p.stamp > estimator_time;
                            estimator_time = p.stamp;
                          },
                          [this](const Scan& scan, DropReason reason) { drops.emplace_back(scan.stamp, reason); }}) {}

  void ScanAt(Stamp stamp, std::uint64_t sequence = 0) {
    auto scan = std::make_shared<Scan>();
    scan->stamp = stamp;
    scan->sequence = sequence;
    pairing.Add(std::move(scan));
  }
  // False where this sample, or one held back before it, was refused.
  bool OdometryAt(Stamp stamp, double x, std::uint64_t sequence = 0) {
    const std::uint64_t refused = pairing.odometry_refused();
    pairing.Add(Odometry{sequence, stamp, {x, 0, 0}});
    return pairing.odometry_refused() == refused;
  }

  struct Paired {
    Stamp stamp;
    Pose2 T_odom_robot;
    bool operator==(const Paired&) const = default;
  };
  std::vector<Paired> pairs;
  std::vector<std::pair<Stamp, DropReason>> drops;
  bool grows = true;  // The estimator's time, from pair to pair.
  Stamp estimator_time = 0;
  OdometryPairing pairing;
};

constexpr Stamp kSecond = kNanosPerSecond;

TEST(OdometryPairing, ExactStampsPairAtOnceInEitherOrder) {
  Pairing p;
  EXPECT_TRUE(p.OdometryAt(1 * kSecond, 5));
  p.ScanAt(1 * kSecond);
  ASSERT_EQ(p.pairs.size(), 1u);
  EXPECT_EQ(p.pairs[0].T_odom_robot.x, 5);
  p.ScanAt(2 * kSecond);
  EXPECT_EQ(p.pairing.waiting(), 1u);
  EXPECT_TRUE(p.OdometryAt(2 * kSecond, 6));
  ASSERT_EQ(p.pairs.size(), 2u);
  EXPECT_EQ(p.pairs[1].T_odom_robot.x, 6);
}

TEST(OdometryPairing, InterpolatesBetweenItsNeighbours) {
  Pairing p;
  p.OdometryAt(1 * kSecond, 0);
  p.ScanAt(1 * kSecond + kSecond / 4);
  EXPECT_THAT(p.pairs, IsEmpty());
  p.OdometryAt(2 * kSecond, 8);
  ASSERT_EQ(p.pairs.size(), 1u);
  EXPECT_NEAR(p.pairs[0].T_odom_robot.x, 2.0, 1e-12);
}

// The sample that belongs to one scan exactly is also the one before the next scan.
TEST(OdometryPairing, AnExactPairLeavesItsSampleForTheNextScan) {
  Pairing p;
  p.OdometryAt(1 * kSecond, 1);
  p.ScanAt(1 * kSecond);
  p.ScanAt(1 * kSecond + kSecond / 2);
  p.OdometryAt(2 * kSecond, 2);
  ASSERT_EQ(p.pairs.size(), 2u);
  EXPECT_NEAR(p.pairs[1].T_odom_robot.x, 1.5, 1e-12);
}

TEST(OdometryPairing, ScansBeforeTheFirstOdometryAreDropped) {
  Pairing p;
  p.ScanAt(1 * kSecond);
  p.ScanAt(2 * kSecond);
  p.OdometryAt(2 * kSecond, 3);
  EXPECT_THAT(p.drops, ElementsAre(Pair(1 * kSecond, DropReason::kNoOdometry)));
  EXPECT_EQ(p.pairs.size(), 1u);
}

TEST(OdometryPairing, AGapInTheOdometryDropsTheScansInIt) {
  PairingOptions options;
  options.max_gap_s = 1.0;
  Pairing p(options);
  p.OdometryAt(1 * kSecond, 0);
  p.ScanAt(2 * kSecond);
  p.OdometryAt(3 * kSecond, 1);
  p.ScanAt(3 * kSecond + 1);
  p.OdometryAt(4 * kSecond, 1);
  EXPECT_THAT(p.drops, ElementsAre(Pair(2 * kSecond, DropReason::kNoOdometry)));
  EXPECT_EQ(p.pairs.size(), 1u);
}

TEST(OdometryPairing, FinishUsesTheLastOdometryWhileItIsFresh) {
  PairingOptions options;
  options.max_gap_s = 1.0;
  Pairing p(options);
  p.OdometryAt(kSecond / 2, 3);
  p.OdometryAt(1 * kSecond, 7);
  p.ScanAt(2 * kSecond);
  p.ScanAt(2 * kSecond + 1);
  p.pairing.Finish();
  ASSERT_EQ(p.pairs.size(), 1u);
  EXPECT_EQ(p.pairs[0].T_odom_robot.x, 7);
  EXPECT_THAT(p.drops, ElementsAre(Pair(2 * kSecond + 1, DropReason::kNoOdometry)));
  EXPECT_EQ(p.pairing.waiting(), 0u);
}

TEST(OdometryPairing, FinishWithoutAnyOdometryDropsAll) {
  Pairing p;
  p.ScanAt(1);
  p.pairing.Finish();
  EXPECT_THAT(p.drops, ElementsAre(Pair(1, DropReason::kNoOdometry)));
}

TEST(OdometryPairing, StampsThatRepeatOrGoBackAreRefused) {
  Pairing p;
  EXPECT_TRUE(p.OdometryAt(5 * kSecond, 0));
  EXPECT_FALSE(p.OdometryAt(5 * kSecond, 1));
  EXPECT_FALSE(p.OdometryAt(4 * kSecond, 1));
  p.ScanAt(5 * kSecond);
  p.ScanAt(5 * kSecond);
  p.ScanAt(4 * kSecond);
  p.ScanAt(std::numeric_limits<Stamp>::min());
  EXPECT_EQ(p.pairs.size(), 1u);
  EXPECT_THAT(p.drops,
              ElementsAre(Pair(5 * kSecond, DropReason::kDuplicateStamp), Pair(4 * kSecond, DropReason::kStampWentBack),
                          Pair(std::numeric_limits<Stamp>::min(), DropReason::kStampWentBack)));
}

TEST(OdometryPairing, OneStampFarAheadIsRefusedAndStopsNothing) {
  constexpr Stamp kYear = 365 * 24 * 3600 * kSecond;
  for (const Stamp wrong : {1000 * kSecond, kYear, std::numeric_limits<Stamp>::max()}) {
    Pairing p;
    p.OdometryAt(1 * kSecond, 0);
    EXPECT_TRUE(p.OdometryAt(wrong, 0));  // Held back: it may be right.
    EXPECT_FALSE(p.OdometryAt(2 * kSecond, 0));
    p.ScanAt(1 * kSecond);
    p.ScanAt(wrong);
    EXPECT_THAT(p.drops, IsEmpty());
    p.ScanAt(2 * kSecond);
    EXPECT_EQ(p.pairs.size(), 2u);
    EXPECT_THAT(p.drops, ElementsAre(Pair(wrong, DropReason::kStampJump)));
    EXPECT_EQ(p.pairing.odometry_refused(), 1u);
  }
}

// A stream that pauses, or whose clock is set ahead, waits for a few stamps and then loses nothing.
TEST(OdometryPairing, AJumpAheadIsBelievedOnceOthersAgreeAndNothingIsLost) {
  PairingOptions options;
  options.jump_confirmations = 3;
  Pairing p(options);
  const Stamp later = 1'000'000 * kSecond;
  for (const Stamp t : {1 * kSecond, later, later + kSecond, later + 2 * kSecond}) p.OdometryAt(t, 0);
  p.ScanAt(1 * kSecond);
  p.ScanAt(later);
  p.ScanAt(later + kSecond);
  EXPECT_EQ(p.pairs.size(), 1u);
  p.ScanAt(later + 2 * kSecond);
  EXPECT_EQ(p.pairs.size(), 4u);
  EXPECT_THAT(p.drops, IsEmpty());
  EXPECT_EQ(p.pairing.odometry_refused(), 0u);
}

TEST(OdometryPairing, AtTheEndTwoStampsThatAgreeAreBelievedAndOneIsNot) {
  Pairing p;
  for (const Stamp t : {1 * kSecond, 100 * kSecond, 101 * kSecond}) p.OdometryAt(t, 0);
  for (const Stamp t : {1 * kSecond, 100 * kSecond, 101 * kSecond}) p.ScanAt(t);
  p.pairing.Finish();
  EXPECT_EQ(p.pairs.size(), 3u);
  Pairing alone;
  for (const Stamp t : {1 * kSecond, 100 * kSecond}) alone.OdometryAt(t, 0);
  for (const Stamp t : {1 * kSecond, 100 * kSecond}) alone.ScanAt(t);
  alone.pairing.Finish();
  EXPECT_EQ(alone.pairs.size(), 1u);
  EXPECT_THAT(alone.drops, ElementsAre(Pair(100 * kSecond, DropReason::kStampJump)));
}

TEST(OdometryPairing, ScatteredJumpsProveNothing) {
  PairingOptions options;
  options.jump_confirmations = 2;
  Pairing p(options);
  p.ScanAt(1 * kSecond);
  p.ScanAt(1'000'000 * kSecond);
  p.ScanAt(2 * kSecond);  // The true clock goes on: the count starts anew.
  p.ScanAt(1'000'001 * kSecond);
  p.ScanAt(2'000'000 * kSecond);  // Far from the one before.
  p.ScanAt(1 * kSecond);          // Late; what is ahead was not followed.
  EXPECT_THAT(
      p.drops,
      ElementsAre(Pair(1'000'000 * kSecond, DropReason::kStampJump), Pair(1'000'001 * kSecond, DropReason::kStampJump),
                  Pair(2'000'000 * kSecond, DropReason::kStampJump), Pair(1 * kSecond, DropReason::kStampWentBack)));
  EXPECT_EQ(p.pairing.waiting(), 2u);
}

// A robot whose first stamp was a year ahead, before its clock was set, was not heard until the year was over.
TEST(OdometryPairing, AWrongFirstStampIsOvercomeByTheNextOnes) {
  constexpr Stamp kYear = 365 * 24 * 3600 * kSecond;
  for (const bool odometry_too : {false, true}) {
    Pairing p;
    p.ScanAt(kYear);
    if (odometry_too) p.OdometryAt(kYear, 0);
    for (int i = 1; i <= 20; ++i) {
      p.OdometryAt(i * kSecond, i);
      p.ScanAt(i * kSecond);
    }
    ASSERT_GE(p.pairs.size(), 15u);
    EXPECT_EQ(p.pairs.back().stamp, 20 * kSecond);
    EXPECT_EQ(p.pairs.back().T_odom_robot.x, 20);
    EXPECT_EQ(p.pairs.size() + p.drops.size(), 21u);
    EXPECT_TRUE(p.grows);
    EXPECT_EQ(p.estimator_time - p.pairs.back().stamp > kYear / 2, odometry_too);
  }
}

// A clock set back by an hour muted its robot for an hour.
TEST(OdometryPairing, AClockSetBackIsBelievedAfterAFewStampsAndTimeGrowsAllTheSame) {
  for (const bool scans_first : {true, false}) {
    Pairing p;
    const auto both = [&](Stamp stamp, double x) {
      if (scans_first) p.ScanAt(stamp);
      p.OdometryAt(stamp, x);
      if (!scans_first) p.ScanAt(stamp);
    };
    for (int i = 0; i < 50; ++i) both(3600 * kSecond + i * kSecond / 10, 0.1 * i);
    ASSERT_EQ(p.pairs.size(), 50u);
    for (int i = 0; i < 50; ++i) both(i * kSecond / 10, 5.0 + 0.1 * i);
    EXPECT_GE(p.pairs.size(), 90u);
    EXPECT_EQ(p.pairs.size() + p.drops.size(), 100u);
    EXPECT_GE(std::count(p.drops.begin(), p.drops.end(), std::pair(Stamp{0}, DropReason::kStampWentBack)), 1);
    EXPECT_TRUE(p.grows);
    for (std::size_t i = 50; i < p.pairs.size(); ++i)  // Never joined with odometry of the old clock.
      EXPECT_NEAR(p.pairs[i].T_odom_robot.x, 5.0 + static_cast<double>(p.pairs[i].stamp) / kSecond, 1e-9);
  }
}

// The clock is set back by two seconds and then passes through the same stamps a second time.
TEST(OdometryPairing, OdometryOfBeforeTheClockWasSetBackIsForgotten) {
  for (const bool scans_first : {true, false}) {
    Pairing p;
    const auto both = [&](Stamp stamp, double x) {
      if (scans_first) p.ScanAt(stamp);
      p.OdometryAt(stamp + kSecond / 25, x);
      if (!scans_first) p.ScanAt(stamp);
    };
    for (int i = 0; i < 50; ++i) both(100 * kSecond + i * kSecond / 10, 0.0);
    const std::size_t before = p.pairs.size();
    for (int i = 0; i < 60; ++i) both(103 * kSecond + i * kSecond / 10, 1000.0);
    EXPECT_GE(p.pairs.size(), before + 50);
    for (std::size_t i = before; i < p.pairs.size(); ++i) {
      // The last scan of the old clock may still get the odometry of its own time.
      if (p.pairs[i].stamp < 104 * kSecond) {
        EXPECT_EQ(p.pairs[i].T_odom_robot.x, 1000.0) << p.pairs[i].stamp;
      }
    }
  }
}

TEST(OdometryPairing, ScansThatWaitWhenTheOdometrysClockIsSetBackAreDropped) {
  PairingOptions options;
  options.jump_confirmations = 3;
  Pairing p(options);
  p.OdometryAt(100 * kSecond, 0);
  p.ScanAt(100 * kSecond);
  p.ScanAt(101 * kSecond);
  EXPECT_EQ(p.pairing.waiting(), 1u);
  for (const Stamp t : {50, 51, 52}) p.OdometryAt(t * kSecond, 0);
  EXPECT_EQ(p.pairing.waiting(), 0u);
  EXPECT_THAT(p.drops, ElementsAre(Pair(101 * kSecond, DropReason::kNoOdometry)));
}

TEST(OdometryPairing, AfterAClockWasSetBackTimeGrowsAsFastAsTheRobotsClock) {
  Pairing p;
  for (int i = 0; i < 10; ++i) {
    p.OdometryAt((1000 + i) * kSecond, 0);
    p.ScanAt((1000 + i) * kSecond);
  }
  for (int i = 0; i < 10; ++i) {
    p.OdometryAt(i * kSecond, 0);
    p.ScanAt(i * kSecond);
  }
  const Stamp estimator_time = p.estimator_time;
  p.OdometryAt(10 * kSecond, 0);
  p.ScanAt(10 * kSecond);
  EXPECT_EQ(p.estimator_time, estimator_time + kSecond);
}

// Between the last pair and the change of the clock, scans had found no odometry; the clock was set back to exactly the
// stamp of the last pair.
TEST(OdometryPairing, AClockSetBackToTheLastPairGivesALaterTimeAllTheSame) {
  PairingOptions options;
  options.jump_confirmations = 3;
  Pairing p(options);
  p.OdometryAt(10 * kSecond, 0);
  for (const Stamp t : {10, 11, 12}) p.ScanAt(t * kSecond);
  ASSERT_EQ(p.pairs.size(), 1u);
  for (const Stamp t : {7, 8, 9}) p.OdometryAt(t * kSecond, 0);
  for (const Stamp t : {8, 9, 10}) p.ScanAt(t * kSecond);
  p.OdometryAt(10 * kSecond, 0);
  ASSERT_EQ(p.pairs.size(), 2u);
  EXPECT_EQ(p.pairs[1].stamp, 10 * kSecond);
  EXPECT_TRUE(p.grows);
}

// Odometry, too, is sent again after a pause of the network.
TEST(OdometryPairing, LateOdometryIsNoClockSetBack) {
  Pairing p;
  for (int i = 1; i <= 60; ++i) {
    p.OdometryAt(i * kSecond, 0, static_cast<std::uint64_t>(i));
    p.ScanAt(i * kSecond, static_cast<std::uint64_t>(i));
  }
  for (int i = 20; i <= 40; ++i) p.OdometryAt(i * kSecond + 1, 0, static_cast<std::uint64_t>(i));
  EXPECT_EQ(p.pairing.odometry_refused(), 21u);
  p.OdometryAt(61 * kSecond, 0, 61);
  p.ScanAt(61 * kSecond, 61);
  EXPECT_EQ(p.pairs.size(), 61u);
  EXPECT_EQ(p.estimator_time, 61 * kSecond);
}

// Scans sent again after a pause of the network are behind in their numbers, too: no clock has changed.
TEST(OdometryPairing, LateScansAreNoClockSetBack) {
  Pairing p;
  for (int i = 1; i <= 60; ++i) {
    p.OdometryAt(i * kSecond, 0);
    p.ScanAt(i * kSecond, static_cast<std::uint64_t>(i));
  }
  for (int i = 20; i <= 40; ++i) p.ScanAt(i * kSecond + 1, static_cast<std::uint64_t>(i));
  EXPECT_EQ(p.drops.size(), 21u);
  p.OdometryAt(61 * kSecond, 0);
  p.ScanAt(61 * kSecond, 61);
  EXPECT_EQ(p.pairs.size(), 61u);
  EXPECT_EQ(p.estimator_time, 61 * kSecond);
}

// The robot was started again, and its computer has no clock of its own: stamps and numbers begin anew.
TEST(OdometryPairing, ANewClientMayBringAnEarlierClockAndNumbersOfItsOwn) {
  Pairing p;
  for (int i = 1; i <= 30; ++i) {
    p.OdometryAt((1000 + i) * kSecond, 0, static_cast<std::uint64_t>(i));
    p.ScanAt((1000 + i) * kSecond, static_cast<std::uint64_t>(i));
  }
  p.pairing.NewClient();
  for (int i = 1; i <= 20; ++i) {
    p.OdometryAt(i * kSecond, 0, static_cast<std::uint64_t>(i));
    p.ScanAt(i * kSecond, static_cast<std::uint64_t>(i));
  }
  EXPECT_GE(p.pairs.size(), 40u);
  EXPECT_TRUE(p.grows);
}

// Whatever stamps come, the estimator's time grows and every scan has one fate.
TEST(OdometryPairing, TimeGrowsUnderRandomStamps) {
  std::mt19937_64 random(11);
  for (int run = 0; run < 200; ++run) {
    PairingOptions options;
    options.jump_confirmations = 2 + static_cast<std::int64_t>(random() % 3);
    Pairing p(options);
    Stamp clock = 0;
    std::size_t scans = 0;
    for (int i = 0; i < 300; ++i) {
      clock += kSecond / 10;
      if (random() % 40 == 0) clock = static_cast<Stamp>(random()) / 4;  // Anywhere, far from zero or below it.
      if (random() % 40 == 0) clock = static_cast<Stamp>(random() % 1000) * kSecond;
      const Stamp stamp = random() % 30 == 0 ? static_cast<Stamp>(random()) : clock;
      p.OdometryAt(stamp, 0);
      p.ScanAt(stamp);
      ++scans;
    }
    p.pairing.Finish();
    ASSERT_TRUE(p.grows) << run;
    ASSERT_EQ(p.pairs.size() + p.drops.size(), scans) << run;
    ASSERT_GT(p.pairs.size(), 20u) << run;
  }
}

TEST(OdometryPairing, WaitingScansAreBounded) {
  PairingOptions options;
  options.max_waiting_scans = 3;
  Pairing p(options);
  for (int i = 1; i <= 5; ++i) p.ScanAt(i * kSecond);
  EXPECT_EQ(p.pairing.waiting(), 3u);
  EXPECT_THAT(p.drops,
              ElementsAre(Pair(1 * kSecond, DropReason::kNoOdometry), Pair(2 * kSecond, DropReason::kNoOdometry)));
}

TEST(OdometryPairing, OdometryIsBoundedAndTheNewestIsKept) {
  PairingOptions two;
  two.max_odometry = 2;
  Pairing least(two);
  least.OdometryAt(1 * kSecond, 1);
  least.OdometryAt(2 * kSecond, 2);
  least.ScanAt(1 * kSecond + kSecond / 2);
  ASSERT_EQ(least.pairs.size(), 1u);  // Two samples are kept, not one.
  EXPECT_NEAR(least.pairs[0].T_odom_robot.x, 1.5, 1e-9);

  PairingOptions options;
  options.max_odometry = 10;
  Pairing p(options);
  for (int i = 1; i <= 100; ++i) p.OdometryAt(i * kSecond, i);
  p.ScanAt(88 * kSecond);                // Forgotten.
  p.ScanAt(95 * kSecond + kSecond / 2);  // Still known.
  EXPECT_THAT(p.drops, ElementsAre(Pair(88 * kSecond, DropReason::kNoOdometry)));
  ASSERT_EQ(p.pairs.size(), 1u);
  EXPECT_NEAR(p.pairs[0].T_odom_robot.x, 95.5, 1e-9);
}

// Two streams with equal stamps, gaps, repeats and steps back; any interleaving that keeps each stream's order must
// give the same pairs and, per stream order, the same fates. What was said before a clock was set back does depend on
// the interleaving, so nothing here may be believed to be one.
TEST(OdometryPairing, PairsDoNotDependOnHowTheStreamsInterleave) {
  std::mt19937_64 random(42);
  std::vector<Stamp> scans, odometries;
  for (Stamp t = 0; t < 40 * kSecond; t += static_cast<Stamp>(random() % (kSecond / 2))) {
    scans.push_back(random() % 17 == 0 && t > kSecond ? t - kSecond : t);
  }
  for (Stamp t = 3 * kSecond; t < 38 * kSecond; t += static_cast<Stamp>(random() % (kSecond / 3))) {
    if (t > 20 * kSecond && t < 23 * kSecond) continue;  // A gap.
    odometries.push_back(random() % 19 == 0 ? t - kSecond / 2 : t);
    // Some odometry stamps equal scan stamps.
    if (random() % 5 == 0 && t > scans[0]) odometries.push_back(scans[scans.size() / 2]);
  }
  PairingOptions options;
  options.max_waiting_scans = 10'000;
  options.max_odometry = 10'000;
  options.jump_confirmations = 1000;
  const auto run = [&](std::uint64_t seed) {
    std::mt19937_64 order(seed);
    Pairing p(options);
    std::size_t s = 0, o = 0;
    while (s < scans.size() || o < odometries.size()) {
      // Bursts of different length: from strictly alternating to one stream wholly before the other.
      const bool scan_next = o == odometries.size() || (s < scans.size() && order() % (seed % 7 + 2) == 0);
      if (scan_next) {
        p.ScanAt(scans[s++]);
      } else {
        p.OdometryAt(odometries[o], static_cast<double>(o) * 0.01);
        ++o;
      }
    }
    p.pairing.Finish();
    std::sort(p.drops.begin(), p.drops.end());
    return std::pair(p.pairs, p.drops);
  };
  const auto expected = run(1);
  EXPECT_GT(expected.first.size(), 50u);
  EXPECT_GT(expected.second.size(), 5u);
  EXPECT_EQ(expected.first.size() + expected.second.size(), scans.size());
  for (std::uint64_t seed = 2; seed < 100; ++seed) EXPECT_EQ(run(seed), expected) << seed;
}

}  // namespace
}  // namespace cairn::slam
