// Scans of a robot that sends no odometry, or none at first.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "server/slam/scan/odometry_pairing.h"
#include "tests/server/slam/scan/pairing.h"

namespace cairn::slam {
namespace {

using test::kSecond;
using test::Pairing;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(PairingWithoutOdometry, FinishWithoutAnyOdometryUsesTheScansAlone) {
  Pairing p;
  p.ScanAt(1);
  p.pairing.Finish();
  EXPECT_THAT(p.drops, IsEmpty());
  EXPECT_THAT(p.with_odometry, ElementsAre(false));
}

TEST(PairingWithoutOdometry, ScansThatHaveWaitedForTheFirstOdometryAreUsedWithoutAny) {
  PairingOptions options;
  options.no_odometry_after_s = 2.0;
  options.no_odometry_after_scans = 100;
  Pairing p(options);
  for (int i = 0; i < 20; ++i) p.ScanAt(kSecond + i * kSecond / 10);
  EXPECT_THAT(p.pairs, IsEmpty());
  EXPECT_FALSE(p.pairing.without_odometry());
  p.ScanAt(3 * kSecond);
  EXPECT_EQ(p.pairs.size(), 21u);
  EXPECT_TRUE(p.pairing.without_odometry());
  p.ScanAt(4 * kSecond);  // Waits no more.
  EXPECT_EQ(p.pairs.size(), 22u);
  EXPECT_EQ(p.pairing.waiting(), 0u);
  EXPECT_EQ(std::count(p.with_odometry.begin(), p.with_odometry.end(), false), 22);
  EXPECT_THAT(p.drops, IsEmpty());

  options.no_odometry_after_scans = 5;
  Pairing many(options);
  for (int i = 1; i <= 4; ++i) many.ScanAt(i);
  EXPECT_THAT(many.pairs, IsEmpty());
  many.ScanAt(5);
  EXPECT_EQ(many.pairs.size(), 5u);
}

TEST(PairingWithoutOdometry, OdometryThatBeginsLaterIsUsedFromThenOn) {
  PairingOptions options;
  options.no_odometry_after_scans = 2;
  Pairing p(options);
  p.ScanAt(1 * kSecond);
  p.ScanAt(2 * kSecond);
  p.OdometryAt(2 * kSecond + kSecond / 2, 7);
  p.ScanAt(3 * kSecond);
  EXPECT_EQ(p.pairs.size(), 2u);  // The third one waits for its odometry.
  p.OdometryAt(3 * kSecond + kSecond / 2, 9);
  p.ScanAt(3 * kSecond + kSecond / 4);
  ASSERT_EQ(p.pairs.size(), 4u);
  EXPECT_EQ(p.pairs[2].T_odom_robot.x, 8);
  EXPECT_THAT(p.with_odometry, ElementsAre(false, false, true, true));
  EXPECT_THAT(p.passages, ElementsAre(Passage::kDriven, Passage::kDriven, Passage::kOdometryBegan, Passage::kDriven));
  EXPECT_FALSE(p.pairing.without_odometry());
}

// Who has not been watched meanwhile cannot be followed on.
TEST(PairingWithoutOdometry, OdometryThatBeginsAfterAPauseOrWithAnotherClientSaysNothingOfTheStepToIt) {
  PairingOptions options;
  options.no_odometry_after_scans = 2;
  for (const bool pause : {true, false}) {
    Pairing p(options);
    p.ScanAt(1 * kSecond);
    p.ScanAt(2 * kSecond);
    if (!pause) p.pairing.NewClient();
    const Stamp next = (pause ? 8 : 3) * kSecond;
    p.OdometryAt(next, 7);
    p.ScanAt(next);
    ASSERT_EQ(p.pairs.size(), 3u);
    EXPECT_EQ(p.passages.back(), Passage::kUnknown) << pause;
  }
}

}  // namespace
}  // namespace cairn::slam
