#include "server/slam/site/site_smoothing.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/server/slam/site/site_drives.h"

namespace cairn::slam {
namespace {

using test::DriveRing;
using test::ErrorBetween;
using test::RingCorridor;
using test::RobotDrive;

bool GoOn(double /*share*/) {
  return true;
}

std::vector<SmoothedSession> Smooth(const std::vector<SiteSession>& sessions) {
  auto smoothed = SmoothSessions(sessions, SiteOptionsOf(MapperOptions{}), GoOn);
  return smoothed ? *std::move(smoothed) : std::vector<SmoothedSession>(sessions.size());
}

// Each sees a part of the ring of 112 m that the other has seen as well, and a part that it has not.
struct TwoRobots : ::testing::Test {
  static const RobotDrive& First() {
    static const RobotDrive drive = DriveRing(RingCorridor(true), 0.0, 72.0, {}, 1);
    return drive;
  }
  static const RobotDrive& Second() {
    static const RobotDrive drive = DriveRing(RingCorridor(true), 30.0, 70.0, {5.0, -3.0, 1.0}, 2);
    return drive;
  }
  // How the second robot's map lies in the world, which is the first one's map but for its drift.
  static Pose2 T_first_second() { return Second().truth.front() * Second().snapshot.full_path.front().Inverse(); }
};

TEST_F(TwoRobots, WithoutStartsAreJoinedWhereTheyHaveSeenTheSame) {
  const auto smoothed = Smooth({{First().snapshot, false}, {Second().snapshot, false}});
  for (const SmoothedSession& session : smoothed) {
    EXPECT_TRUE(session.joined);
    EXPECT_EQ(session.frame, 0U);
    EXPECT_GT(session.relations, 50U);
    EXPECT_GT(session.agreement, 0.95);
  }
  EXPECT_EQ(smoothed[0].T_site_own, Pose2{});
  EXPECT_LT((smoothed[1].T_site_own.translation() - T_first_second().translation()).norm(), 0.5);
  EXPECT_LT(ErrorBetween(First(), smoothed[0].path, Second(), smoothed[1].path), 0.6);
}

TEST_F(TwoRobots, LieAlikeWhicheverBegan) {
  const auto smoothed = Smooth({{First().snapshot, false}, {Second().snapshot, false}});
  const auto reversed = Smooth({{Second().snapshot, false}, {First().snapshot, false}});
  ASSERT_TRUE(smoothed[1].joined && reversed[1].joined);
  EXPECT_EQ(reversed[0].T_site_own, Pose2{});
  for (std::size_t k = 0; k < smoothed[1].path.size(); k += 10) {
    const Pose2 one = Between(smoothed[0].path.back(), smoothed[1].path[k]);
    const Pose2 other = Between(reversed[1].path.back(), reversed[0].path[k]);
    EXPECT_LT((one.translation() - other.translation()).norm(), 0.15) << "keyframe " << k;
  }
}

TEST_F(TwoRobots, AStartThatIsKnownGivesTheFrame) {
  const auto smoothed = Smooth({{First().snapshot, false}, {Second().snapshot, true}});
  ASSERT_TRUE(smoothed[0].joined && smoothed[1].joined);
  EXPECT_EQ(smoothed[0].frame, 1U);
  EXPECT_EQ(smoothed[1].T_site_own, Pose2{});
  EXPECT_LT((smoothed[0].T_site_own.translation() - T_first_second().Inverse().translation()).norm(), 0.5);
}

// The second one's start is said to be (5, -3), where the first one sees something else.
TEST_F(TwoRobots, AWrongStartGivesWayToWhatWasSeen) {
  const auto smoothed = Smooth({{First().snapshot, true}, {Second().snapshot, true}});
  ASSERT_TRUE(smoothed[1].joined);
  EXPECT_EQ(smoothed[1].frame, 0U);
  EXPECT_LT((smoothed[1].T_site_own.translation() - T_first_second().translation()).norm(), 0.5);
}

TEST_F(TwoRobots, AreSmoothedToTheSameBytesEveryTime) {
  const auto one = Smooth({{First().snapshot, false}, {Second().snapshot, false}});
  const auto other = Smooth({{First().snapshot, false}, {Second().snapshot, false}});
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].path, other[i].path);
    EXPECT_EQ(one[i].relations, other[i].relations);
  }
}

TEST_F(TwoRobots, ARobotOfAnotherBuildingStaysAsItIs) {
  const RobotDrive elsewhere = DriveRing(RingCorridor(true, 77), 10.0, 60.0, {1.0, 1.0, 0.5}, 3);
  const auto smoothed = Smooth({{First().snapshot, false}, {Second().snapshot, false}, {elsewhere.snapshot, false}});
  EXPECT_TRUE(smoothed[0].joined && smoothed[1].joined);
  EXPECT_FALSE(smoothed[2].joined);
  EXPECT_EQ(smoothed[2].frame, 2U);
  EXPECT_EQ(smoothed[2].relations, 0U);
  EXPECT_EQ(smoothed[2].agreement, 0.0);
  EXPECT_EQ(smoothed[2].path, elsewhere.snapshot.full_path);
}

TEST_F(TwoRobots, ARobotWithoutScansIsNoHindrance) {
  const MapperSnapshot nothing;
  const auto smoothed = Smooth({{nothing, false}, {First().snapshot, false}, {Second().snapshot, false}});
  EXPECT_FALSE(smoothed[0].joined);
  EXPECT_TRUE(smoothed[0].path.empty());
  EXPECT_TRUE(smoothed[1].joined && smoothed[2].joined);
}

TEST_F(TwoRobots, AreNotJoinedWhenAskedToStop) {
  int asked = 0;
  const std::vector<SiteSession> sessions{{First().snapshot, false}, {Second().snapshot, false}};
  EXPECT_FALSE(SmoothSessions(sessions, SiteOptionsOf(MapperOptions{}), [&asked](double) { return ++asked < 5; }));
  EXPECT_LT(asked, 10) << "it ends at once";
}

TEST_F(TwoRobots, TheWorkDoneOnlyGrows) {
  std::vector<double> shares;
  const std::vector<SiteSession> sessions{{First().snapshot, false}, {Second().snapshot, false}};
  ASSERT_TRUE(SmoothSessions(sessions, SiteOptionsOf(MapperOptions{}), [&shares](double share) {
    shares.push_back(share);
    return true;
  }));
  EXPECT_TRUE(std::ranges::is_sorted(shares));
  EXPECT_EQ(shares.front(), 0.0);
  EXPECT_LT(shares.back(), 1.0);
}

// Every place of a side looks like the place 4 m further on. Who has seen some of them can not know which.
TEST(EqualRooms, AreNoProof) {
  const test::World world = test::RingOfEqualRooms();
  const RobotDrive first = DriveRing(world, 2.0, 30.0, {}, 1),
                   second = DriveRing(world, 10.0, 26.0, {3.0, 3.0, 2.0}, 2);
  for (const SmoothedSession& session : Smooth({{first.snapshot, false}, {second.snapshot, false}}))
    EXPECT_FALSE(session.joined);
}

// But who knows where they start may say that they are the same.
TEST(EqualRooms, AreTheSameWhereTheStartsSaySo) {
  const test::World world = test::RingOfEqualRooms();
  const RobotDrive first = DriveRing(world, 2.0, 30.0, {2.0, 0.0, 0.0}, 1);
  const RobotDrive second = DriveRing(world, 10.0, 26.0, {10.2, 0.1, 0.01}, 2);
  const auto smoothed = Smooth({{first.snapshot, true}, {second.snapshot, true}});
  ASSERT_TRUE(smoothed[1].joined);
  EXPECT_LT(ErrorBetween(first, smoothed[0].path, second, smoothed[1].path), 0.3);
}

}  // namespace
}  // namespace cairn::slam
