#include "server/slam/matchers/differential_evolution.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <vector>

namespace cairn::slam {
namespace {

// Runs two ranges in reverse order, each in its own thread.
void TwoThreads(int count, const std::function<void(int, int)>& body) {
  std::thread second([&] { body(count / 2, count); });
  body(0, count / 2);
  second.join();
}

const SearchBox kBox{{-2, -3, -1}, {4, 5, 2}};
const Eigen::Vector3d kOptimum{1.3, -0.7, 0.4};

double Bowl(const Eigen::Vector3d& x) {
  return (x - kOptimum).cwiseAbs2().dot(Eigen::Vector3d(1, 4, 9));
}

// Many local minima, 1 apart, and one best (Rastrigin's function around the optimum).
double Eggs(const Eigen::Vector3d& x) {
  const Eigen::Array3d d = x - kOptimum;
  return (d.square() + 0.5 * (1.0 - (2.0 * M_PI * d).cos())).sum();
}

EvolutionOptions OptionsOf(EvolutionStrategy strategy) {
  EvolutionOptions options;
  options.strategy = strategy;
  options.scale = 0.6;
  options.generations = 300;
  options.stop_cost = 1e-8;
  return options;
}

class EveryStrategy : public testing::TestWithParam<int> {
 protected:
  [[nodiscard]] EvolutionStrategy strategy() const { return static_cast<EvolutionStrategy>(GetParam()); }
};

TEST_P(EveryStrategy, FindsTheBottomOfABowlAndTheDeepestOfManyHollows) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    std::mt19937_64 engine(seed);
    const EvolutionResult bowl = Evolve(Bowl, kBox, OptionsOf(strategy()), engine, SerialFor);
    EXPECT_EQ(bowl.stop, EvolutionStop::kCost) << seed;
    EXPECT_LT((bowl.best - kOptimum).norm(), 1e-3) << seed;
    const EvolutionResult eggs = Evolve(Eggs, kBox, OptionsOf(strategy()), engine, SerialFor);
    EXPECT_LT((eggs.best - kOptimum).norm(), 1e-2) << seed;
  }
}

TEST_P(EveryStrategy, NeverLeavesTheBox) {
  const SearchBox narrow{{-0.1, 2, 0}, {0.2, 2, 1e-3}};  // One side of the box has no width.
  EvolutionOptions options = OptionsOf(strategy());
  options.scale = 1.7;
  options.generations = 30;
  const auto cost = [&](const Eigen::Vector3d& x) {
    EXPECT_TRUE((x.array() >= narrow.min.array()).all() && (x.array() <= narrow.max.array()).all()) << x.transpose();
    return -x.sum();
  };
  std::mt19937_64 engine(3);
  const EvolutionResult result = Evolve(cost, narrow, options, engine, SerialFor);
  EXPECT_NEAR(result.best.x(), 0.2, 1e-2);
}

TEST_P(EveryStrategy, DoesNotDependOnTheThreads) {
  std::mt19937_64 one(11), two(11);
  EvolutionOptions options = OptionsOf(strategy());
  options.generations = 20;
  const EvolutionResult serial = Evolve(Eggs, kBox, options, one, SerialFor);
  const EvolutionResult threads = Evolve(Eggs, kBox, options, two, TwoThreads);
  EXPECT_EQ(serial.best, threads.best);
  EXPECT_EQ(serial.cost, threads.cost);
  EXPECT_EQ(one, two);
}

INSTANTIATE_TEST_SUITE_P(StornAndPrice, EveryStrategy, testing::Range(0, 10), [](const auto& strategy) {
  return std::string(kEvolutionStrategyNames[static_cast<std::size_t>(strategy.param)]);
});

// The first two populations whose cost a run computes: the random one, and its trials.
struct TwoGenerations {
  std::vector<Eigen::Vector3d> first, trials;
};

TwoGenerations Record(const EvolutionOptions& options, const SearchBox& box, std::uint64_t seed) {
  std::vector<Eigen::Vector3d> asked;
  std::mt19937_64 engine(seed);
  (void)Evolve(
      [&](const Eigen::Vector3d& x) {
        asked.push_back(x);
        return Bowl(x);
      },
      box, options, engine, SerialFor);
  const auto half = asked.begin() + static_cast<std::ptrdiff_t>(asked.size() / 2);
  return {{asked.begin(), half}, {half, asked.end()}};
}

// Thesis C 2.4.6 and de36.c, implemented a second time. `r` are members other than the target, all different.
Eigen::Vector3d AsPrinted(const std::string& name, const std::vector<Eigen::Vector3d>& x, int target, int best,
                          double F, const std::vector<int>& r) {
  const auto at = [&](int k) { return x[static_cast<std::size_t>(r[static_cast<std::size_t>(k)])]; };
  const Eigen::Vector3d xi = x[static_cast<std::size_t>(target)], xb = x[static_cast<std::size_t>(best)];
  if (name.starts_with("best_1")) return xb + F * (at(0) - at(1));
  if (name.starts_with("rand_1")) return at(0) + F * (at(1) - at(2));
  if (name.starts_with("rand_to_best")) return xi + F * (xb - xi) + F * (at(0) - at(1));
  if (name.starts_with("best_2")) return xb + F * (at(0) + at(1) - at(2) - at(3));
  return at(4) + F * (at(0) + at(1) - at(2) - at(3));
}

TEST_P(EveryStrategy, PerturbsAsPrinted) {
  const std::string name(kEvolutionStrategyNames[static_cast<std::size_t>(GetParam())]);
  EvolutionOptions options = OptionsOf(strategy());
  options.population = 6;
  options.generations = 1;
  options.scale = 0.37;
  options.crossover = 1.0;  // Every variable comes from the perturbed vector.
  const SearchBox box{{-20, -20, -20}, {20, 20, 20}};
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto [first, trials] = Record(options, box, seed);
    ASSERT_EQ(trials.size(), 6U);
    const auto least =
        std::min_element(first.begin(), first.end(), [](const auto& a, const auto& b) { return Bowl(a) < Bowl(b); });
    const int best = static_cast<int>(least - first.begin());
    for (int target = 0; target < 6; ++target) {
      std::vector<int> r;
      for (int k = 0; k < 6; ++k)
        if (k != target) r.push_back(k);
      bool found = false, mirrored = false;
      do {
        const Eigen::Vector3d expected = AsPrinted(name, first, target, best, options.scale, r);
        found |= (expected - trials[static_cast<std::size_t>(target)]).norm() < 1e-9;
        mirrored |= (expected.array().abs() > 20.0).any();
      } while (std::next_permutation(r.begin(), r.end()));
      EXPECT_TRUE(found || mirrored) << seed << ", target " << target;
      compared += found ? 1 : 0;
    }
  }
  EXPECT_GT(compared, 20);
}

// With three variables, exponential crossover takes 1 + CR + CR^2 of them on average, which are neighbours;
// binomial crossover takes 1 + 2 CR.
TEST_P(EveryStrategy, CrossesAsManyVariablesAsItsNameSays) {
  EvolutionOptions options = OptionsOf(strategy());
  options.generations = 1;
  options.crossover = 0.4;
  double taken = 0.0, trials_in_all = 0.0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const auto [first, trials] = Record(options, {{-20, -20, -20}, {20, 20, 20}}, seed);
    for (std::size_t i = 0; i < trials.size(); ++i)
      taken += static_cast<double>((trials[i].array() != first[i].array()).count());
    trials_in_all += static_cast<double>(trials.size());
  }
  const bool binomial = GetParam() >= 5;
  EXPECT_NEAR(taken / trials_in_all, binomial ? 1 + 2 * 0.4 : 1 + 0.4 + 0.16, 0.03);
}

TEST(DifferentialEvolution, StrategiesDifferFromEachOther) {
  std::vector<double> costs;
  for (int strategy = 0; strategy < 10; ++strategy) {
    std::mt19937_64 engine(5);
    EvolutionOptions options = OptionsOf(static_cast<EvolutionStrategy>(strategy));
    options.generations = 10;
    options.crossover = 0.5;
    options.stop_cost = 0.0;
    costs.push_back(Evolve(Eggs, kBox, options, engine, SerialFor).cost);
  }
  std::sort(costs.begin(), costs.end());
  EXPECT_EQ(std::unique(costs.begin(), costs.end()), costs.end());
}

TEST(DifferentialEvolution, StopsByCostOrByGenerations) {
  std::mt19937_64 engine(1);
  EvolutionOptions options;
  options.stop_cost = 1e9;
  EvolutionResult result = Evolve(Bowl, kBox, options, engine, SerialFor);
  EXPECT_EQ(result.stop, EvolutionStop::kCost);
  EXPECT_EQ(result.generations, 0);
  EXPECT_EQ(result.evaluations, 100);
  options.stop_cost = -1.0;
  result = Evolve(Bowl, kBox, options, engine, SerialFor);
  EXPECT_EQ(result.stop, EvolutionStop::kGenerations);
  EXPECT_EQ(result.generations, 50);
  EXPECT_EQ(result.evaluations, 5100);
}

TEST(DifferentialEvolution, MoreGenerationsNeverMakeItWorseAndFortyHalveTheCost) {
  double before = std::numeric_limits<double>::infinity(), at_first = 0.0;
  for (const int generations : {0, 5, 10, 20, 40}) {
    std::mt19937_64 engine(9);
    EvolutionOptions options;
    options.generations = generations;
    options.stop_cost = 0.0;
    const double cost = Evolve(Eggs, kBox, options, engine, SerialFor).cost;
    EXPECT_LE(cost, before);
    before = cost;
    if (generations == 0) at_first = cost;
  }
  EXPECT_LT(before, 0.5 * at_first);
}

TEST(DifferentialEvolution, TheSmallestPopulationAndBadCostsEnd) {
  std::mt19937_64 engine(2);
  EvolutionOptions options;
  options.strategy = EvolutionStrategy::kRand2Bin;  // This strategy needs five other members.
  options.population = 6;
  EXPECT_TRUE(Evolve(Bowl, kBox, options, engine, SerialFor).best.allFinite());
  const auto nan = [](const Eigen::Vector3d&) { return std::numeric_limits<double>::quiet_NaN(); };
  EXPECT_EQ(Evolve(nan, kBox, options, engine, SerialFor).generations, options.generations);
}

}  // namespace
}  // namespace cairn::slam
