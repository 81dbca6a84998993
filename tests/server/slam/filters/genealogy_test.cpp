#include "server/slam/filters/genealogy.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/slam/filters/resampling.h"

namespace cairn::slam {
namespace {

const Eigen::Vector3d kUnit = Eigen::Vector3d::Ones();

std::vector<Eigen::Vector3d> AlongX(const std::vector<double>& values) {
  std::vector<Eigen::Vector3d> deviations;
  for (const double value : values) deviations.emplace_back(value, 0.0, 0.0);
  return deviations;
}

double VarianceX(const Genealogy& genealogy, const std::vector<double>& values) {
  const std::vector<double> shares(values.size(), 1.0 / static_cast<double>(values.size()));
  return genealogy.VarianceOfMean(shares, AlongX(values), kUnit)(0, 0);
}

TEST(Genealogy, IndependentParticlesHaveTheVarianceOfAMean) {
  const Genealogy genealogy(4);
  EXPECT_DOUBLE_EQ(VarianceX(genealogy, {2.0, -2.0, 2.0, -2.0}), 4.0 / 4.0);
  const std::vector<double> shares = {0.5, 0.5, 0.0, 0.0};
  const std::vector<Eigen::Vector3d> deviations = {{1, 2, 0}, {-1, -2, 0}, {9, 9, 9}, {9, 9, 9}};
  Eigen::Matrix3d expected;
  expected << 0.5, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0;
  EXPECT_TRUE(genealogy.VarianceOfMean(shares, deviations, kUnit).isApprox(expected, 1e-12));
}

TEST(Genealogy, SiblingsErrAlike) {
  Genealogy genealogy(4);
  genealogy.Add(std::vector<int>{0, 0, 3, 3});
  // Two families of two: a mean of two numbers, not of four.
  EXPECT_DOUBLE_EQ(VarianceX(genealogy, {2.0, 2.0, -2.0, -2.0}), 4.0 / 2.0);
  // Within the families they have parted since, which one generation back does not show: independent again.
  EXPECT_DOUBLE_EQ(VarianceX(genealogy, {2.0, -2.0, 2.0, -2.0}), 4.0 / 4.0);
}

TEST(Genealogy, FollowsAncestorsOverGenerationsAndKeepsTheLagThatStillHasSeveral) {
  Genealogy genealogy(6);
  genealogy.Add(std::vector<int>{0, 0, 2, 2, 4, 4});
  EXPECT_EQ(genealogy.depth(), 1u);
  genealogy.Add(std::vector<int>{0, 1, 1, 4, 5, 5});
  EXPECT_EQ(genealogy.depth(), 2u);
  // Families of the first generation now: {0, 1, 2} of 0 and {3, 4, 5} of 4.
  EXPECT_DOUBLE_EQ(VarianceX(genealogy, {1, 1, 1, -1, -1, -1}), 1.0 / 2.0);
  genealogy.Add(std::vector<int>{3, 3, 3, 4, 5, 5});
  // All descend from one of the first generation; of the second there are {0, 1, 2} and {3, 4, 5}, of the third
  // {0, 1, 2}, {3} and {4, 5}.
  EXPECT_EQ(genealogy.depth(), 2u);
  EXPECT_DOUBLE_EQ(VarianceX(genealogy, {1, 1, 1, 1, -2, -2}), (9.0 + 1.0 + 16.0) / 36.0);
  genealogy.Add(std::vector<int>{2, 2, 2, 2, 2, 2});
  EXPECT_EQ(genealogy.depth(), 0u);
}

TEST(Genealogy, AgreesWithTheErrorOfManyFilters) {
  // A chain that forgets (0.9 a step), resampled at random after every step: the spread of the particles says nothing
  // of how far their mean is off, the families do.
  constexpr int kRuns = 400, kSteps = 40, kMembers = 100;
  double squared_error = 0.0, claimed = 0.0, naive = 0.0;
  Rng rng(3);
  for (int run = 0; run < kRuns; ++run) {
    Genealogy genealogy(kMembers);
    std::vector<double> x(kMembers, 0.0);
    for (int step = 0; step < kSteps; ++step) {
      std::vector<double> log_weights;
      for (double& value : x) {
        value = 0.9 * value + NormalDraw(rng);
        log_weights.push_back(NormalDraw(rng));
      }
      const std::vector<int> parents = StratifiedSurvivors(NormalisedWeights(log_weights), rng);
      std::vector<double> next;
      for (const int parent : parents) next.push_back(x[static_cast<std::size_t>(parent)]);
      x = std::move(next);
      genealogy.Add(parents);
    }
    double mean = 0.0;
    for (const double value : x) mean += value / kMembers;
    for (double& value : x) value -= mean;
    for (const double value : x) naive += value * value / kMembers / kMembers / kRuns;
    squared_error += mean * mean / kRuns;  // The chain has mean 0.
    claimed += VarianceX(genealogy, x) / kRuns;
  }
  EXPECT_NEAR(claimed / squared_error, 1.0, 0.3);
  EXPECT_LT(naive / squared_error, 0.3);
}

}  // namespace
}  // namespace cairn::slam
