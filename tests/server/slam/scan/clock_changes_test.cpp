// What pairing does when the clock of a robot is wrong at first, is set ahead or back, or begins anew.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>

#include "tests/server/slam/scan/pairing.h"

namespace cairn::slam {
namespace {

using test::kSecond;
using test::Pairing;
using testing::ElementsAre;
using testing::Pair;

// A robot whose first stamp was a year ahead, before its clock was set, had its scans refused until the year was over.
TEST(ClockChanges, AWrongFirstStampIsOvercomeByTheNextOnes) {
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
TEST(ClockChanges, AClockSetBackIsBelievedAfterAFewStampsAndTimeGrowsAllTheSame) {
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
TEST(ClockChanges, OdometryOfBeforeTheClockWasSetBackIsForgotten) {
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

TEST(ClockChanges, ScansThatWaitWhenTheOdometrysClockIsSetBackAreDropped) {
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

// A replay that sends no more until scans have been used waited for ever: the stream that noticed the change later
// threw away what the other one had sent of the new time.
TEST(ClockChanges, WhatOneStreamHasSentOfTheNewTimeStaysWhenTheOtherFollows) {
  for (const bool odometry_first : {true, false}) {
    Pairing p;
    for (int i = 0; i < 50; ++i) {
      p.OdometryAt(100 * kSecond + i * kSecond / 10, 0);
      p.ScanAt(100 * kSecond + i * kSecond / 10);
    }
    const std::size_t before = p.pairs.size();
    for (const bool odometry : {odometry_first, !odometry_first}) {
      for (int i = 0; i < 20; ++i) {
        if (odometry) p.OdometryAt(i * kSecond / 10, 0.1 * i);
        if (!odometry) p.ScanAt(i * kSecond / 10);
      }
    }
    // Five stamps show that the clock was set back, and the last of them counts.
    EXPECT_EQ(p.pairs.size(), before + 16);
    EXPECT_EQ(p.pairing.waiting(), 0u);
    for (std::size_t i = before; i < p.pairs.size(); ++i)
      EXPECT_NEAR(p.pairs[i].T_odom_robot.x, static_cast<double>(p.pairs[i].stamp) / kSecond, 1e-9);
    EXPECT_TRUE(p.grows);
  }
}

TEST(ClockChanges, AfterAClockWasSetBackTimeGrowsAsFastAsTheRobotsClock) {
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
TEST(ClockChanges, AClockSetBackToTheLastPairGivesALaterTimeAllTheSame) {
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
TEST(ClockChanges, LateOdometryIsNoClockSetBack) {
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
TEST(ClockChanges, LateScansAreNoClockSetBack) {
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
TEST(ClockChanges, ANewClientMayBringAnEarlierClockAndNumbersOfItsOwn) {
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
TEST(ClockChanges, TimeGrowsUnderRandomStamps) {
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

}  // namespace
}  // namespace cairn::slam
