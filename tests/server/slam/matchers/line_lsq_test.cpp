#include "server/slam/matchers/line_lsq.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/slam/features/feature_extraction.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::World;

ScanFeatures FeaturesFrom(const World& world, const Pose2& pose, const Laser& laser = {}) {
  return ExtractFeatures(test::Look(world, pose, laser), FeatureOptions{});
}

// A corridor with door niches on both sides and an end wall, as in 5.4.3: from two places, different parts of
// the walls are seen.
World CorridorWithDoors() {
  World world;
  world.Add(
      {{-4, -1}, {1.5, -1}, {1.5, -1.3}, {2.5, -1.3}, {2.5, -1}, {6, -1}, {6, -1.25}, {7, -1.25}, {7, -1}, {11, -1}});
  world.Add({{11, -1}, {11, 1.1}, {4.2, 1.1}, {4.2, 1.45}, {3.2, 1.45}, {3.2, 1.1}, {-4, 1.1}});
  return world;
}

double ErrorOf(const Pose2& answer, const Pose2& truth) {
  return (answer.translation() - truth.translation()).norm() + std::abs(AngleDiff(answer.theta, truth.theta));
}

TEST(LineLsq, AlignsTwoPlacesOfACorridorWhereTheFirstPairsAloneFail) {
  const Pose2 start{0, 0, 0.05}, motion{0.3, 0.06, 0.14};
  const ScanFeatures prev = FeaturesFrom(CorridorWithDoors(), start),
                     curr = FeaturesFrom(CorridorWithDoors(), start * motion);
  const MatchPrior nothing_known;
  LineLsqOptions once;
  once.max_rounds = 1;
  const LineLsqMatch first = MatchLinesByLeastSquares(prev, curr, nothing_known, once);
  const LineLsqMatch match = MatchLinesByLeastSquares(prev, curr, nothing_known, {});
  std::printf("one round of association: error %.3f; with association in %d rounds: %.4f\n",
              ErrorOf(first.result.T_ref_curr, motion), match.result.iterations,
              ErrorOf(match.result.T_ref_curr, motion));
  EXPECT_GT(ErrorOf(first.result.T_ref_curr, motion), 0.1);
  ASSERT_TRUE(match.result.converged);
  EXPECT_LT(ErrorOf(match.result.T_ref_curr, motion), 0.02);
  EXPECT_FALSE(match.result.degenerate);
  EXPECT_GT(match.result.iterations, 1);
  EXPECT_LE(match.result.iterations, 50);  // The number that the thesis found to be sufficient (Figure 5.18).
  EXPECT_LT(match.errors.back(), 0.2 * match.errors.front());
}

TEST(LineLsq, EachLineIsUsedOnce) {
  const ScanFeatures prev = FeaturesFrom(test::Office(), {}), curr = FeaturesFrom(test::Office(), {0.2, 0.1, 0.05});
  const std::vector<LinePair> pairs = AssociateLines(prev.lines, curr.lines, {0.2, 0.1, 0.05}, 100, {});
  ASSERT_GE(pairs.size(), 4U);
  std::vector<int> used_prev, used_curr;
  for (const LinePair& pair : pairs) {
    EXPECT_EQ(std::count(used_prev.begin(), used_prev.end(), pair.ref), 0);
    EXPECT_EQ(std::count(used_curr.begin(), used_curr.end(), pair.curr), 0);
    used_prev.push_back(pair.ref);
    used_curr.push_back(pair.curr);
  }
}

TEST(LineLsq, TheGatesAreThoseOfTheThesisInTheEnd) {
  LineFeature wall;
  wall.first = {2, -1}, wall.last = {2, 1}, wall.length = 2, wall.slope = kPi / 2;
  const std::vector<LineFeature> walls{wall};
  LineAssociationOptions options;
  const auto pairs_at = [&](const Pose2& T) { return AssociateLines(walls, walls, T, 100, options).size(); };
  EXPECT_EQ(pairs_at({0.09, 0, 0}), 1U);
  EXPECT_EQ(pairs_at({0.11, 0, 0}), 0U);
  EXPECT_EQ(AssociateLines(walls, walls, {0.11, 0, 0}, 0, options).size(), 1U);  // The first round has a wider gate.
  options.max_across_m = 1.0;
  EXPECT_EQ(pairs_at({0, 0, Radians(4.9)}), 1U);
  EXPECT_EQ(pairs_at({0, 0, Radians(5.1)}), 0U);
}

}  // namespace
}  // namespace cairn::slam
