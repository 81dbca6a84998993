#include "server/slam/site/site_smoothing.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/server/slam/site/site_drives.h"

namespace cairn::slam {
namespace {

using test::DriveRing;
using test::ErrorBetween;
using test::FirstOf;
using test::RingCorridor;
using test::RobotDrive;

std::vector<SmoothedSession> Smooth(const std::vector<SiteSession>& sessions, std::vector<double>* shares = nullptr) {
  auto smoothed = SmoothSessions(sessions, SiteOptionsOf(MapperOptions{}), [shares](double share) {
    if (shares != nullptr) shares->push_back(share);
    return true;
  });
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
  // Both together, nobody knows where they started.
  static const std::vector<SmoothedSession>& Together() {
    static const std::vector<SmoothedSession> smoothed =
        Smooth({{First().snapshot, false}, {Second().snapshot, false}}, &Shares());
    return smoothed;
  }
  // The share of the work that was done, whenever it was told.
  static std::vector<double>& Shares() {
    static std::vector<double> shares;
    return shares;
  }
  // How the second robot's map lies in the world, which is the first one's map but for its drift.
  static Pose2 T_first_second() { return Second().truth.front() * Second().snapshot.full_path.front().Inverse(); }
};

TEST_F(TwoRobots, WithoutStartsAreJoinedWhereTheyHaveSeenTheSame) {
  for (const SmoothedSession& session : Together()) {
    EXPECT_TRUE(session.joined);
    EXPECT_EQ(session.frame, 0U);
    EXPECT_GT(session.relations, 50U);
    EXPECT_GT(session.agreement, 0.95);
  }
  EXPECT_EQ(Together()[0].T_site_own, Pose2{});
  EXPECT_LT((Together()[1].T_site_own.translation() - T_first_second().translation()).norm(), 0.5);
  EXPECT_LT(ErrorBetween(First(), Together()[0].path, Second(), Together()[1].path), 0.6);
}

TEST_F(TwoRobots, LieAlikeWhicheverBegan) {
  const auto reversed = Smooth({{Second().snapshot, false}, {First().snapshot, false}});
  ASSERT_TRUE(reversed[0].joined && reversed[1].joined);
  EXPECT_EQ(reversed[0].T_site_own, Pose2{});
  for (std::size_t k = 0; k < reversed[0].path.size(); k += 10) {
    const Pose2 one = Between(Together()[0].path.back(), Together()[1].path[k]);
    const Pose2 other = Between(reversed[1].path.back(), reversed[0].path[k]);
    EXPECT_LT((one.translation() - other.translation()).norm(), 0.15) << "keyframe " << k;
  }
}

// The second one's start is said to be (5, -3), where the first one sees something else.
TEST_F(TwoRobots, AWrongStartGivesWayToWhatWasSeen) {
  const auto smoothed = Smooth({{First().snapshot, true}, {Second().snapshot, true}});
  ASSERT_TRUE(smoothed[1].joined);
  EXPECT_EQ(smoothed[1].frame, 0U);
  EXPECT_LT((smoothed[1].T_site_own.translation() - T_first_second().translation()).norm(), 0.5);
}

TEST_F(TwoRobots, AreSmoothedToTheSameBytesEveryTime) {
  const auto again = Smooth({{First().snapshot, false}, {Second().snapshot, false}});
  for (std::size_t i = 0; i < again.size(); ++i) {
    EXPECT_EQ(again[i].path, Together()[i].path);
    EXPECT_EQ(again[i].relations, Together()[i].relations);
  }
}

// One robot has seen nothing yet, and one drives in another building.
TEST_F(TwoRobots, RobotsThatHaveSeenNothingOfItStayAsTheyAre) {
  const MapperSnapshot nothing;
  const RobotDrive elsewhere = DriveRing(RingCorridor(true, 77), 10.0, 60.0, {1.0, 1.0, 0.5}, 3);
  const auto smoothed =
      Smooth({{nothing, false}, {First().snapshot, false}, {Second().snapshot, false}, {elsewhere.snapshot, false}});
  EXPECT_FALSE(smoothed[0].joined);
  EXPECT_TRUE(smoothed[0].path.empty());
  EXPECT_TRUE(smoothed[1].joined && smoothed[2].joined);
  EXPECT_FALSE(smoothed[3].joined);
  EXPECT_EQ(smoothed[3].frame, 3U);
  EXPECT_EQ(smoothed[3].relations, 0U);
  EXPECT_EQ(smoothed[3].agreement, 0.0);
  EXPECT_EQ(smoothed[3].path, elsewhere.snapshot.full_path);
}

TEST_F(TwoRobots, AreNotJoinedWhenAskedToStop) {
  int asked = 0;
  const std::vector<SiteSession> sessions{{First().snapshot, false}, {Second().snapshot, false}};
  EXPECT_FALSE(SmoothSessions(sessions, SiteOptionsOf(MapperOptions{}), [&asked](double) { return ++asked < 5; }));
  EXPECT_LT(asked, 10) << "it ends at once";
}

TEST_F(TwoRobots, TheWorkDoneOnlyGrows) {
  ASSERT_TRUE(Together()[0].joined);
  EXPECT_TRUE(std::ranges::is_sorted(Shares()));
  EXPECT_EQ(Shares().front(), 0.0);
  EXPECT_LT(Shares().back(), 1.0);
}

// A second job measures only what is new, and comes to the same result.
TEST_F(TwoRobots, WhatAJobHasMeasuredTheNextOneKnows) {
  const std::size_t before = Second().snapshot.keyframes.size() - 5;
  const MapperSnapshot earlier = FirstOf(Second().snapshot, before);
  RelationBook book;
  const auto run = [&](const MapperSnapshot& second) {
    book.BeginJob();
    const std::vector<SiteSession> sessions{{First().snapshot, false, 4}, {second, false, 7}};
    auto smoothed = SmoothSessions(
        sessions, SiteOptionsOf(MapperOptions{}), [](double) { return true; }, SiteSearch::kAll, &book);
    book.EndJob([](std::uint64_t) { return true; });
    return *std::move(smoothed);
  };
  static_cast<void>(run(earlier));
  const std::size_t measured = book.measured();
  ASSERT_GT(measured, 50U);
  const auto joined = run(Second().snapshot);
  EXPECT_LT(book.measured(), measured / 10);
  EXPECT_GT(book.reused(), measured / 2);
  ASSERT_TRUE(joined[0].joined && joined[1].joined);
  for (std::size_t k = 0; k < joined[1].path.size(); k += 10)
    EXPECT_LT((joined[1].path[k].translation() - Together()[1].path[k].translation()).norm(), 0.15) << k;
  static_cast<void>(run(Second().snapshot));
  EXPECT_LE(book.measured(), 2U) << "nothing is new";
}

// Otherwise all would be drawn again.
TEST_F(TwoRobots, WhereNothingIsNewNothingMoves) {
  RelationBook book;
  const std::vector<SiteSession> sessions{{First().snapshot, false, 4}, {Second().snapshot, false, 7}};
  const auto run = [&] {
    book.BeginJob();
    auto smoothed = *SmoothSessions(
        sessions, SiteOptionsOf(MapperOptions{}), [](double) { return true; }, SiteSearch::kAll, &book);
    book.EndJob([](std::uint64_t) { return true; });
    return smoothed;
  };
  const auto apart = [](const std::vector<Pose2>& a, const std::vector<Pose2>& b) {
    double most_m = 0.0;
    for (std::size_t k = 0; k < a.size(); ++k)
      most_m = std::max(most_m, (a[k].translation() - b[k].translation()).norm());
    return most_m;
  };
  const auto once = run(), twice = run();
  ASSERT_TRUE(once[1].joined && twice[1].joined);
  EXPECT_LT(apart(once[1].path, twice[1].path), 0.005);
  ASSERT_NE(book.PathOf(7), nullptr);
  EXPECT_EQ(book.PathOf(7)->path, twice[1].path);
  EXPECT_EQ(book.PathOf(7)->frame, 4U);
  // A path of another shape than that of the session now is of no use. Neither is one in the frame of another session.
  SolvedPath bent = *book.PathOf(7), elsewhere = bent;
  for (std::size_t k = 0; k < bent.path.size(); ++k) bent.path[k].y += 0.02 * static_cast<double>(k);
  elsewhere.frame = 9;
  for (const SolvedPath& wrong : {bent, elsewhere}) {
    book.SetPath(7, wrong);
    EXPECT_LT(apart(run()[1].path, twice[1].path), 0.005);
  }
}

// A job that only looks for the places of robots leaves the rest to the next one.
TEST_F(TwoRobots, AFragmentIsJoinedByWhatIsNeeded) {
  const std::vector<SiteSession> sessions{{First().snapshot, true}, {Second().snapshot, false}};
  const auto smoothed = *SmoothSessions(
      sessions, SiteOptionsOf(MapperOptions{}), [](double) { return true; }, SiteSearch::kFragments);
  ASSERT_TRUE(smoothed[0].joined && smoothed[1].joined);
  EXPECT_GT(smoothed[1].agreement, 0.95);
  EXPECT_LT(ErrorBetween(First(), smoothed[0].path, Second(), smoothed[1].path), 0.6);
}

// A cancelled job has not worked in vain.
TEST_F(TwoRobots, WhatACancelledJobHasMeasuredIsKept) {
  RelationBook book;
  const std::vector<SiteSession> sessions{{First().snapshot, false, 4}, {Second().snapshot, false, 7}};
  EXPECT_FALSE(SmoothSessions(
      sessions, SiteOptionsOf(MapperOptions{}), [&book](double) { return book.measured() < 3; }, SiteSearch::kAll,
      &book));
  EXPECT_GE(book.size(), 3U);
}

// Two wings of a building look alike. One robot has seen one of them, the other one both; it is the other one's own map
// that tells that a wing is no proof.
TEST(EqualWings, AreNoProofForWhoHasSeenBoth) {
  const test::World world = RingCorridor(true);
  const RobotDrive one = DriveRing(world, 0.0, 50.0, {}, 1);
  RobotDrive both = DriveRing(world, 0.0, 50.0, {3.0, 3.0, 2.0}, 2);
  const RobotDrive first_wing = both;
  const RobotDrive other_wing = DriveRing(world, 0.0, 50.0, {90.0, 40.0, -1.0}, 3);
  for (std::size_t k = 0; k < other_wing.truth.size(); ++k) {
    Keyframe keyframe = other_wing.snapshot.keyframes[k];
    both.snapshot.keyframes.push_back(std::move(keyframe));
    both.snapshot.online_path.push_back(other_wing.snapshot.online_path[k]);
    both.snapshot.full_path.push_back(other_wing.snapshot.full_path[k]);
  }
  for (const SmoothedSession& session : Smooth({{one.snapshot, false}, {first_wing.snapshot, false}}))
    EXPECT_TRUE(session.joined);
  for (const SmoothedSession& session : Smooth({{one.snapshot, false}, {both.snapshot, false}}))
    EXPECT_FALSE(session.joined);
}

// The last metres of one are the first of the other: what looks the same there may do so elsewhere as well.
TEST(ShortOverlap, IsNoProof) {
  const test::World world = RingCorridor(true);
  const RobotDrive first = DriveRing(world, 0.0, 38.0, {}, 1),
                   second = DriveRing(world, 24.0, 40.0, {3.0, 3.0, 2.0}, 2);
  for (const SmoothedSession& session : Smooth({{first.snapshot, false}, {second.snapshot, false}}))
    EXPECT_FALSE(session.joined);
}

// What places cover counts, not how far apart they end: they overlap.
TEST(Overlap, JustLongEnoughIsProof) {
  const test::World world = RingCorridor(true);
  const RobotDrive first = DriveRing(world, 0.0, 50.0, {}, 1),
                   second = DriveRing(world, 24.0, 40.0, {3.0, 3.0, 2.0}, 2);
  for (const SmoothedSession& session : Smooth({{first.snapshot, false}, {second.snapshot, false}}))
    EXPECT_TRUE(session.joined);
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
