#include "server/slam/scan/odometry_pairing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/server/slam/scan/pairing.h"

namespace cairn::slam {
namespace {

using test::kSecond;
using test::Pairing;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

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
  p.OdometryAt(2 * kSecond, 2);
  ASSERT_EQ(p.pairs.size(), 1u);
  EXPECT_NEAR(p.pairs[0].T_odom_robot.x, 0.5, 1e-12);
}

// Scans whose stamps are 0.25 s late get the odometry of 0.25 s before; they keep their stamps.
TEST(OdometryPairing, ALagIsTakenOutOfTheOdometry) {
  PairingOptions options;
  options.laser_lag_s = 0.25;
  Pairing p(options);
  p.OdometryAt(1 * kSecond, 0);
  p.OdometryAt(2 * kSecond, 2);
  p.ScanAt(2 * kSecond);
  ASSERT_EQ(p.pairs.size(), 1u);
  EXPECT_NEAR(p.pairs[0].T_odom_robot.x, 1.5, 1e-12);
  EXPECT_EQ(p.pairs[0].stamp, 2 * kSecond);
}

// The same for a lag that was learned meanwhile: it counts from the next scan on, and late odometry is still there.
TEST(OdometryPairing, ALagThatWasLearnedCountsFromTheNextScanOn) {
  Pairing p;
  for (int i = 0; i <= 50; ++i) p.OdometryAt(kSecond + i * kSecond / 50, 0.02 * i);
  p.ScanAt(2 * kSecond);
  p.pairing.SetLag(0.25);
  p.ScanAt(2 * kSecond + kSecond / 10);
  ASSERT_EQ(p.pairs.size(), 2u);
  EXPECT_NEAR(p.pairs[0].T_odom_robot.x, 1.0, 1e-12);
  EXPECT_NEAR(p.pairs[1].T_odom_robot.x, 0.85, 1e-12);
  EXPECT_EQ(p.pairs[1].stamp, 2 * kSecond + kSecond / 10);
  // Earlier stamps of scans wait for odometry.
  p.pairing.SetLag(-0.25);
  p.ScanAt(2 * kSecond + 2 * kSecond / 10);
  EXPECT_EQ(p.pairing.waiting(), 1u);
  p.OdometryAt(2 * kSecond + 5 * kSecond / 10, 1.5);
  ASSERT_EQ(p.pairs.size(), 3u);
  EXPECT_NEAR(p.pairs[2].T_odom_robot.x, 1.45, 1e-12);
}

// Speeds come from dense odometry between the scans, and do not depend on how much of it has arrived after the scan.
TEST(OdometryPairing, TheSpeedAtAScanComesFromDenseOdometryBetweenScans) {
  for (const int late : {0, 3}) {
    Pairing p;
    for (int i = 0; i <= 40; ++i) {
      p.OdometryAt(kSecond + i * kSecond / 20, i < 20 ? 0.0 : 0.05 * (i - 20));
      if (i % 4 == late) p.ScanAt(kSecond + (i - late) * kSecond / 20);
    }
    ASSERT_GE(p.rates.size(), 9u);
    EXPECT_EQ(p.rates[0], Pose2{});  // No scan before it.
    EXPECT_NEAR(p.rates[4].x, 0.0, 1e-9);
    EXPECT_NEAR(p.rates[6].x, 1.0, 1e-9);
  }
  Pairing alone;  // Odometry that comes with the scans.
  for (int i = 0; i <= 40; ++i) {
    alone.OdometryAt(kSecond + i * kSecond / 20, 0.05 * i);
    alone.ScanAt(kSecond + i * kSecond / 20);
  }
  for (const Pose2& rate : alone.rates) EXPECT_EQ(rate, Pose2{});
}

TEST(OdometryPairing, WheelsAreCorrectedStepByStep) {
  PairingOptions options;
  options.wheels = {1.1, 0.5, 0.1};
  Pairing p(options);
  const auto add = [&](Stamp stamp, const Pose2& pose) {
    p.pairing.Add(Odometry{0, stamp, pose});
    p.ScanAt(stamp);
  };
  add(1 * kSecond, {3, 0, 0});
  add(2 * kSecond, {3, 0, 0.4});                        // A turn of 0.4 is one of 0.2,
  add(3 * kSecond, Pose2{3, 0, 0.4} * Pose2{1, 0, 0});  // and a metre is 1.1 m along an arc of 0.1 rad.
  ASSERT_EQ(p.pairs.size(), 3u);
  EXPECT_EQ(p.pairs[0].T_odom_robot.x, 3);
  EXPECT_NEAR(p.pairs[1].T_odom_robot.theta, 0.2, 1e-12);
  EXPECT_NEAR(p.pairs[2].T_odom_robot.theta, 0.3, 1e-12);
  EXPECT_NEAR(p.pairs[2].T_odom_robot.x, 3 + 1.1 * std::cos(0.25), 1e-12);
  EXPECT_NEAR(p.pairs[2].T_odom_robot.y, 1.1 * std::sin(0.25), 1e-12);
}

// Odometry that begins anew elsewhere is no way that wheels have rolled.
TEST(OdometryPairing, AJumpOfOdometryIsNotCorrected) {
  PairingOptions options;
  options.wheels = {1.1, 0.5, 0.1};
  Pairing p(options);
  for (const auto& [stamp, x] : {std::pair{1 * kSecond, 0.0}, {2 * kSecond, 1.0}, {3 * kSecond, 500.0}}) {
    p.OdometryAt(stamp, x);
    p.ScanAt(stamp);
  }
  ASSERT_EQ(p.pairs.size(), 3u);
  EXPECT_NEAR(p.pairs[1].T_odom_robot.theta, 0.1, 1e-12);
  EXPECT_EQ(p.pairs[2].T_odom_robot, (Pose2{500, 0, 0}));
}

// A base that was started again near where it was switched on: no jump is too far for a drive, so zero says it.
TEST(OdometryPairing, OdometryThatBeginsAtZeroIsNotDrivenThere) {
  for (const double x : {0.3, 2.0, 5.0}) {
    for (const double seconds : {0.1, 1.5, 5.0}) {
      Pairing p;
      p.OdometryAt(1 * kSecond, x - 0.01);
      p.OdometryAt(2 * kSecond, x);
      p.ScanAt(2 * kSecond);
      const Stamp anew = 2 * kSecond + StampFromSeconds(seconds);
      p.OdometryAt(anew, 0.0);
      p.ScanAt(anew);
      ASSERT_EQ(p.pairs.size(), 2U) << x;
      EXPECT_EQ(p.passages[1], Passage::kUnknown) << x << " m, " << seconds << " s";
    }
  }
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

TEST(OdometryPairing, WaitingScansAreBounded) {
  PairingOptions options;
  options.max_waiting_scans = 3;
  options.no_odometry_after_s = 100.0;
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
  options.max_waiting_scans = options.no_odometry_after_scans = 10'000;
  options.no_odometry_after_s = 1e6;
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
