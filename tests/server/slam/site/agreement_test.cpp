#include "server/slam/site/agreement.h"

#include <gtest/gtest.h>

#include "tests/server/slam/site/two_sessions.h"

namespace cairn::slam {
namespace {

// The second one begins 10 m later, and drives 10 m farther.
struct AgreementOfTwo : ::testing::Test {
  [[nodiscard]] SessionAgreement Agreement() const { return AgreementOf(a.placed(), b.placed(), options); }

  const test::World world = test::RingCorridor(true);
  test::TestSession a = test::RingSession(0, world, 0.0, 30.0, {});
  test::TestSession b = test::RingSession(1, world, 10.0, 30.0, {5.0, 5.0, 1.0});
  const SiteOptions options = SiteOptionsOf(MapperOptions{});
};

TEST_F(AgreementOfTwo, IsFullWhereBothLieRight) {
  const SessionAgreement agreement = Agreement();
  EXPECT_EQ(agreement.contradicting, 0U);
  EXPECT_GT(agreement.counts.confirmed, 0.98 * agreement.counts.known());
  // A metre of way apart, and only where the other one has seen something.
  EXPECT_GE(agreement.places, 15U);
  EXPECT_LE(agreement.places, 31U);
}

TEST_F(AgreementOfTwo, IsContradictedWhereOneLiesInTheWall) {
  b.Place({0.0, 0.7, 0.0});
  const SessionAgreement agreement = Agreement();
  EXPECT_GT(agreement.counts.contradicted, 0.2 * agreement.counts.known());
  EXPECT_GT(static_cast<double>(agreement.contradicting), 0.5 * static_cast<double>(agreement.places));
}

TEST_F(AgreementOfTwo, SaysNothingWhereTheyNeverMeet) {
  b.Place({500.0, 0.0, 0.0});
  EXPECT_EQ(Agreement().places, 0U);
  EXPECT_EQ(Agreement().counts.known(), 0);
}

TEST_F(AgreementOfTwo, LeavesOutKeyframesThatAreNotLocalized) {
  for (test::TestSession* session : {&a, &b}) {
    test::RobotDrive drive = session->drive;
    for (Keyframe& keyframe : drive.snapshot.keyframes) keyframe.localized = false;
    const test::TestSession lost(session->number, std::move(drive));
    const bool is_a = session == &a;
    EXPECT_EQ(AgreementOf((is_a ? lost : a).placed(), (is_a ? b : lost).placed(), options).places, 0U);
  }
}

}  // namespace
}  // namespace cairn::slam
