#include "server/slam/site/consistent_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "tests/server/slam/site/site_drives.h"

namespace cairn::slam {
namespace {

using Numbers = std::vector<std::size_t>;

TEST(LargestConsistentSet, IsTheLargestInWhichAllAgreeWithEachOther) {
  // 0, 2, 4 and 5 agree with each other. 1 agrees with most of them, and 1 and 3 with each other.
  const std::set<std::pair<std::size_t, std::size_t>> pairs{{0, 2}, {0, 4}, {0, 5}, {2, 4}, {2, 5},
                                                            {4, 5}, {0, 1}, {1, 2}, {1, 3}};
  const auto agree = [&](std::size_t i, std::size_t j) { return pairs.contains({std::min(i, j), std::max(i, j)}); };
  EXPECT_EQ(LargestConsistentSet(6, agree), (Numbers{0, 2, 4, 5}));
}

// A measurement that agrees with many others is no better for it, if those do not agree with each other.
TEST(LargestConsistentSet, IsNotBuiltAroundTheOneWithMostFriends) {
  const std::set<std::pair<std::size_t, std::size_t>> pairs{{0, 1}, {0, 2}, {0, 3}, {0, 4},
                                                            {0, 5}, {6, 7}, {6, 8}, {7, 8}};
  const auto agree = [&](std::size_t i, std::size_t j) { return pairs.contains({std::min(i, j), std::max(i, j)}); };
  EXPECT_EQ(LargestConsistentSet(9, agree), (Numbers{6, 7, 8}));
}

TEST(LargestConsistentSet, IsOneMeasurementWhereNoneAgreeAndNothingWhereThereAreNone) {
  EXPECT_EQ(LargestConsistentSet(3, [](std::size_t, std::size_t) { return false; }).size(), 1U);
  EXPECT_TRUE(LargestConsistentSet(0, [](std::size_t, std::size_t) { return true; }).empty());
}

// Two sessions along the same 30 m; the map of the second one begins elsewhere. Keyframes are half a metre apart.
struct Disagreement : ::testing::Test {
  Disagreement() {
    const std::vector<Pose2> steps(60, Pose2{0.5, 0.0, 0.0});
    for (const Pose2& start : {Pose2{}, Pose2{7.0, 1.0, 0.5}}) {
      const auto drive = test::DriveThrough({}, {}, steps, start, 1, 0.0);
      maps.push_back(std::make_unique<SessionMap>(maps.size() + 1, drive.snapshot, drive.snapshot.full_path,
                                                  SiteOptionsOf(MapperOptions{})));
    }
  }
  [[nodiscard]] double Of(std::size_t first, std::size_t second, const Pose2& error) const {
    const SessionRelation a{{0, first}, {1, first}, {}, PoseCovariance(0.1, 0.02)};
    const SessionRelation b{{0, second}, {1, second}, error, PoseCovariance(0.1, 0.02)};
    return Disagreement2(a, b, *maps[0], *maps[1], LoopOptions{});
  }

  std::vector<std::unique_ptr<SessionMap>> maps;
};

TEST_F(Disagreement, IsNothingBetweenTrueRelationsWhereverTheMapsBegin) {
  EXPECT_LT(Of(5, 50, {}), 1e-9);
}

TEST_F(Disagreement, OfOneThatIsElsewhereOrTurnedIsBeyondTheBound) {
  EXPECT_GT(Of(5, 15, {2.0, 0.0, 0.0}), kMaxChiSquare);
  EXPECT_GT(Of(5, 15, {0.0, 0.0, 0.3}), kMaxChiSquare);
  EXPECT_LT(Of(5, 15, {0.1, 0.1, 0.02}), kMaxChiSquare);
}

// An error of heading at one of them moves the other by the distance between them.
TEST_F(Disagreement, WeighsLessTheFartherTheRelationsAreApart) {
  EXPECT_GT(Of(5, 10, {0.8, 0.0, 0.0}), kMaxChiSquare / 2);
  EXPECT_LT(Of(5, 55, {0.8, 0.0, 0.0}), Of(5, 10, {0.8, 0.0, 0.0}) / 5);
}

TEST_F(Disagreement, IsTheSameInEitherOrder) {
  const SessionRelation a{{0, 5}, {1, 5}, {}, PoseCovariance(0.1, 0.02)};
  const SessionRelation b{{0, 15}, {1, 15}, {0.3, 0.2, 0.0}, PoseCovariance(0.2, 0.03)};
  EXPECT_NEAR(Disagreement2(a, b, *maps[0], *maps[1], {}), Disagreement2(b, a, *maps[0], *maps[1], {}), 1e-9);
}

}  // namespace
}  // namespace cairn::slam
