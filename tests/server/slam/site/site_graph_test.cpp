#include "server/slam/site/site_graph.h"

#include <gtest/gtest.h>

#include "server/slam/site/agreement.h"
#include "server/slam/site/consistent_set.h"
#include "tests/server/slam/site/site_drives.h"

namespace cairn::slam {
namespace {

using test::RobotDrive;

const Eigen::Matrix3d kCovariance = PoseCovariance(0.1, 0.02);

// Two robots along the same 20 m in an empty world; only their paths count. The second one's own map begins elsewhere.
struct TwoPaths : ::testing::Test {
  TwoPaths() {
    const std::vector<Pose2> steps(40, Pose2{0.5, 0.0, 0.0});
    for (const Pose2& start : {Pose2{}, Pose2{7.0, 1.0, 0.5}, Pose2{-4.0, 2.0, 2.0}}) {
      drives.push_back(test::DriveThrough({}, {}, steps, start, 1, 0.0));
      maps.push_back(std::make_unique<SessionMap>(drives.size(), drives.back().snapshot,
                                                  drives.back().snapshot.full_path, SiteOptionsOf(MapperOptions{})));
    }
  }
  SiteGraph Graph(std::vector<bool> start_known) {
    const std::vector<const SessionMap*> all{maps[0].get(), maps[1].get(), maps[2].get()};
    return {all, std::move(start_known), PoseGraphOptions{}};
  }
  // True relations, but for a shift.
  static std::vector<SessionRelation> Relations(std::size_t a, std::size_t b, std::size_t count,
                                                const Pose2& shift = {}) {
    std::vector<SessionRelation> relations;
    for (std::size_t i = 0; i < count; ++i) relations.push_back({{a, 5 * i}, {b, 5 * i}, shift, kCovariance});
    return relations;
  }

  std::vector<RobotDrive> drives;
  std::vector<std::unique_ptr<SessionMap>> maps;
};

TEST_F(TwoPaths, LieOnTopOfEachOtherAfterOneRelation) {
  SiteGraph graph = Graph({false, false, false});
  graph.Add(Relations(0, 1, 1));
  ASSERT_TRUE(graph.Solve({}));
  EXPECT_TRUE(graph.Together(0, 1));
  EXPECT_FALSE(graph.Together(0, 2));
  for (std::size_t k = 0; k < graph.path(0).size(); ++k)
    EXPECT_LT((graph.path(0)[k].translation() - graph.path(1)[k].translation()).norm(), 1e-6);
  EXPECT_EQ(graph.path(2), maps[2]->own_path());
}

TEST_F(TwoPaths, AChainOfRelationsIsOneGroup) {
  SiteGraph graph = Graph({false, false, true});
  graph.Add(Relations(1, 2, 3));
  graph.Add(Relations(0, 1, 3));
  ASSERT_TRUE(graph.Solve({}));
  for (std::size_t s = 0; s < 3; ++s) EXPECT_EQ(graph.frame_of(s), 2U) << "the first whose start is known";
  EXPECT_EQ(graph.path(2).front(), maps[2]->own_path().front());
  EXPECT_LT((graph.path(2).back().translation() - maps[2]->own_path().back().translation()).norm(), 1e-9);
  EXPECT_LT((graph.path(0).back().translation() - graph.path(2).back().translation()).norm(), 1e-6);
  EXPECT_EQ(graph.CountOf(1), 6U);
  graph.RemoveBetween(2, 1);
  ASSERT_TRUE(graph.Solve({}));
  EXPECT_EQ(graph.frame_of(1), 0U);
  EXPECT_EQ(graph.CountOf(1), 3U);
}

// One that says that a robot was 3 m elsewhere, first alone among true ones, then as the majority.
TEST_F(TwoPaths, AFalseRelationIsOutvotedAndDoesNotBendThePath) {
  SiteGraph graph = Graph({false, false, false});
  graph.Add(Relations(0, 1, 6));
  graph.Add(std::vector<SessionRelation>{{{0, 20}, {1, 20}, {3.0, 0.0, 0.0}, kCovariance}});
  ASSERT_TRUE(graph.Solve({}));
  EXPECT_EQ(graph.WithdrawOutvoted(), 1U);
  EXPECT_EQ(graph.WithdrawnOf(0), 1U);
  EXPECT_EQ(graph.CountOf(0), 6U);
  ASSERT_TRUE(graph.Solve({}));
  for (std::size_t k = 0; k < graph.path(0).size(); ++k)
    EXPECT_LT((graph.path(0)[k].translation() - graph.path(1)[k].translation()).norm(), 0.01);
}

// A false relation was believed. Later ones outvote it, and the map recovers.
TEST_F(TwoPaths, WhatWasBelievedIsTakenBackWhenItIsOutvoted) {
  SiteGraph graph = Graph({false, false, false});
  graph.Add(std::vector<SessionRelation>{{{0, 20}, {1, 20}, {3.0, 1.0, 0.3}, kCovariance}});
  ASSERT_TRUE(graph.Solve({}));
  EXPECT_EQ(graph.WithdrawOutvoted(), 0U);
  EXPECT_GT((graph.path(0)[20].translation() - graph.path(1)[20].translation()).norm(), 2.0);
  graph.Add(Relations(0, 1, 6));
  ASSERT_TRUE(graph.Solve({}));
  EXPECT_EQ(graph.WithdrawOutvoted(), 1U);
  ASSERT_TRUE(graph.Solve({}));
  EXPECT_LT((graph.path(0)[20].translation() - graph.path(1)[20].translation()).norm(), 0.01);
}

TEST_F(TwoPaths, AStartIsAPriorThatRelationsOutvote) {
  SiteGraph graph = Graph({true, true, false});
  graph.Add(Relations(0, 1, 6));
  ASSERT_TRUE(graph.Solve({}));
  EXPECT_LT((graph.path(0).front().translation() - graph.path(1).front().translation()).norm(), 0.1);
}

TEST_F(TwoPaths, AreSolvedOnlyWhileOneIsToGoOn) {
  SiteGraph graph = Graph({false, false, false});
  graph.Add(Relations(0, 1, 6, {0.2, 0.0, 0.0}));
  EXPECT_FALSE(graph.Solve([] { return false; }));
}

TEST_F(TwoPaths, RelationsAgreeIfTheWayRoundThroughBothClosesWithinItsDoubt) {
  const LoopOptions loop;
  const SessionRelation one{{0, 0}, {1, 0}, {}, kCovariance}, same{{0, 10}, {1, 10}, {}, kCovariance},
      off{{0, 10}, {1, 10}, {2.0, 0.0, 0.0}, kCovariance}, turned{{0, 10}, {1, 10}, {0.0, 0.0, 0.5}, kCovariance};
  EXPECT_LT(Disagreement2(one, same, *maps[0], *maps[1], loop), 1e-9);
  EXPECT_GT(Disagreement2(one, off, *maps[0], *maps[1], loop), kMaxChiSquare);
  EXPECT_GT(Disagreement2(one, turned, *maps[0], *maps[1], loop), kMaxChiSquare);
  EXPECT_NEAR(Disagreement2(one, off, *maps[0], *maps[1], loop), Disagreement2(off, one, *maps[0], *maps[1], loop),
              1e-6);
}

// The last check of a join: at a wrong place a session sees walls where the other one drove.
TEST(SessionAgreement, IsNearlyCompleteAtTheTruePlaceAndPoorAtAWrongOne) {
  const test::World world = test::RingCorridor(true);
  const SiteOptions options = SiteOptionsOf(MapperOptions{});
  const RobotDrive drive = test::DriveRing(world, 0.0, 60.0, {}, 1), again = test::DriveRing(world, 0.0, 60.0, {}, 2);
  const SessionMap a(1, drive.snapshot, drive.snapshot.full_path, options),
      b(2, again.snapshot, again.snapshot.full_path, options);
  const auto agreement_at = [&](const Pose2& T_true_wrong) {
    PosePath path_a, path_b;
    for (const Pose2& pose : a.own_path()) path_a.Append(pose);
    for (const Pose2& pose : b.own_path()) path_b.Append(T_true_wrong * pose);
    return AgreementOf({0, a, path_a}, {1, b, path_b}, options);
  };
  const SessionAgreement right = agreement_at({}), wrong = agreement_at({0.0, 1.5, 0.0});
  EXPECT_GT(right.places, 50U);
  EXPECT_EQ(right.contradicting, 0U);
  EXPECT_LT(right.counts.contradicted, 0.02 * right.counts.known());
  EXPECT_GT(wrong.places, 20U);
  EXPECT_GT(wrong.counts.contradicted, 0.15 * wrong.counts.known());
  EXPECT_EQ(agreement_at({500.0, 0.0, 0.0}).places, 0U);
}

TEST(LargestConsistentSet, IsTheLargestInWhichAllAgree) {
  // 0, 2, 4, 6 agree with each other, 1 and 3 with each other, and 5 with all but 6.
  const auto agree = [](std::size_t i, std::size_t j) {
    if (i == 5 || j == 5) return i + j != 11;
    return i % 2 == j % 2;
  };
  EXPECT_EQ(LargestConsistentSet(7, agree), (std::vector<std::size_t>{0, 2, 4, 5}));
  EXPECT_EQ(LargestConsistentSet(3, [](auto, auto) { return false; }).size(), 1U);
  EXPECT_TRUE(LargestConsistentSet(0, agree).empty());
}

}  // namespace
}  // namespace cairn::slam
