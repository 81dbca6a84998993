#include "server/slam/random/resampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

TEST(NormalisedWeights, SumToOneHoweverSmallTheLikelihoods) {
  const std::vector<double> weights = NormalisedWeights(std::vector<double>{-5000.0, -5000.0 + std::log(3.0)});
  EXPECT_NEAR(weights[0], 0.25, 1e-12);
  EXPECT_NEAR(weights[1], 0.75, 1e-12);
}

TEST(NormalisedWeights, AreEqualWhereNothingIsKnown) {
  const double lost = -std::numeric_limits<double>::infinity();
  EXPECT_EQ(NormalisedWeights(std::vector<double>{lost, lost}), (std::vector<double>{0.5, 0.5}));
  EXPECT_EQ(NormalisedWeights(std::vector<double>{lost, 0.0}), (std::vector<double>{0.0, 1.0}));
}

TEST(EffectiveSampleSize, RunsFromOneToAll) {
  EXPECT_DOUBLE_EQ(EffectiveSampleSize(std::vector<double>{1.0, 0.0, 0.0}), 1.0);
  EXPECT_DOUBLE_EQ(EffectiveSampleSize(std::vector<double>{0.25, 0.25, 0.25, 0.25}), 4.0);
}

TEST(SharedParentFraction, CountsPairsOfOneParent) {
  EXPECT_DOUBLE_EQ(SharedParentFraction(std::vector<int>{0, 1, 2, 3}), 0.0);
  EXPECT_DOUBLE_EQ(SharedParentFraction(std::vector<int>{2, 2, 2, 2}), 1.0);
  EXPECT_DOUBLE_EQ(SharedParentFraction(std::vector<int>{0, 0, 0, 3}), 3.0 / 6.0);
}

TEST(StratifiedSurvivors, OneInEachStratumOfTheCumulativeWeight) {
  // Particle i gets n * w_i copies, give or take one. This property is the reason to use stratified
  // resampling.
  Rng rng(7);
  const std::vector<double> weights = {0.5, 0.25, 0.125, 0.125};
  std::vector<double> large;
  for (int repeat = 0; repeat < 100; ++repeat)
    for (const double w : weights) large.push_back(w / 100.0);
  const std::vector<int> survivors = StratifiedSurvivors(large, rng);
  ASSERT_EQ(survivors.size(), large.size());
  EXPECT_TRUE(std::is_sorted(survivors.begin(), survivors.end()));
  for (std::size_t i = 0; i < large.size(); ++i) {
    const auto copies = std::count(survivors.begin(), survivors.end(), static_cast<int>(i));
    EXPECT_NEAR(static_cast<double>(copies), large[i] * static_cast<double>(large.size()), 2.0);
  }
}

TEST(NormalDraw, HasMeanZeroAndUnitSpread) {
  Rng rng(11);
  double sum = 0.0, squares = 0.0;
  constexpr int kDraws = 100'000;
  for (int i = 0; i < kDraws; ++i) {
    const double x = NormalDraw(rng);
    sum += x;
    squares += x * x;
  }
  EXPECT_NEAR(sum / kDraws, 0.0, 0.015);
  EXPECT_NEAR(squares / kDraws, 1.0, 0.02);
}

}  // namespace
}  // namespace cairn::slam
