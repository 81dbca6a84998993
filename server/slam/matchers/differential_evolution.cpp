#include "server/slam/matchers/differential_evolution.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace cairn::slam {
namespace {

constexpr int kDimension = 3;

struct Individual {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  double cost = 0.0;
};

// A uniform sample of [0, 1), with the same bits for every standard library.
double Uniform(std::mt19937_64& engine) {
  return static_cast<double>(engine() >> 11) * 0x1.0p-53;
}

int UniformIndex(std::mt19937_64& engine, int count) {
  return std::min(count - 1, static_cast<int>(Uniform(engine) * count));
}

// Five members of the population, different from each other and from the target.
std::array<int, 5> DrawOthers(std::mt19937_64& engine, int population, int target) {
  std::array<int, 5> drawn{};
  for (std::size_t k = 0; k < drawn.size(); ++k) {
    const auto used = [&](int candidate) {
      return candidate == target || std::find(drawn.begin(), drawn.begin() + static_cast<std::ptrdiff_t>(k),
                                              candidate) != drawn.begin() + static_cast<std::ptrdiff_t>(k);
    };
    do drawn[k] = UniformIndex(engine, population);
    while (used(drawn[k]));
  }
  return drawn;
}

bool IsBinomial(EvolutionStrategy strategy) {
  return strategy >= EvolutionStrategy::kBest1Bin;
}

// The perturbed vector of the strategy, whichever its crossover.
Eigen::Vector3d Perturbed(const std::vector<Individual>& population, const std::array<int, 5>& r, int target,
                          const Eigen::Vector3d& best, const EvolutionOptions& options) {
  const auto x = [&](int i) -> const Eigen::Vector3d& { return population[static_cast<std::size_t>(i)].x; };
  const double F = options.scale;
  switch (options.strategy) {
    case EvolutionStrategy::kBest1Exp:
    case EvolutionStrategy::kBest1Bin:
      return best + F * (x(r[0]) - x(r[1]));
    case EvolutionStrategy::kRand1Exp:
    case EvolutionStrategy::kRand1Bin:
      return x(r[0]) + F * (x(r[1]) - x(r[2]));
    case EvolutionStrategy::kRandToBest1Exp:
    case EvolutionStrategy::kRandToBest1Bin:
      return x(target) + F * (best - x(target)) + F * (x(r[0]) - x(r[1]));
    case EvolutionStrategy::kBest2Exp:
    case EvolutionStrategy::kBest2Bin:
      return best + F * (x(r[0]) + x(r[1]) - x(r[2]) - x(r[3]));
    case EvolutionStrategy::kRand2Exp:
    case EvolutionStrategy::kRand2Bin:
      return x(r[4]) + F * (x(r[0]) + x(r[1]) - x(r[2]) - x(r[3]));
  }
  return x(target);
}

// Selects the variables that the trial takes from the perturbed vector: at least one, beginning at a random
// one.
std::array<bool, kDimension> DrawCrossover(std::mt19937_64& engine, const EvolutionOptions& options) {
  std::array<bool, kDimension> taken{};
  auto n = static_cast<std::size_t>(UniformIndex(engine, kDimension));
  if (IsBinomial(options.strategy)) {
    for (int L = 0; L < kDimension; ++L, n = (n + 1) % kDimension)
      taken[n] = Uniform(engine) < options.crossover || L == kDimension - 1;
    return taken;
  }
  int L = 0;
  do {
    taken[n] = true;
    n = (n + 1) % kDimension;
    ++L;
  } while (L < kDimension && Uniform(engine) < options.crossover);
  return taken;
}

// Mirrors a value at the sides of the box until it lies inside.
double Mirrored(double value, double min, double max) {
  const double width = max - min;
  if (!(width > 0.0)) return min;
  const double along = std::fmod(std::abs(value - min), 2.0 * width);
  return std::clamp(min + (along <= width ? along : 2.0 * width - along), min, max);
}

void EvaluateCosts(std::vector<Individual>& individuals, const std::function<double(const Eigen::Vector3d&)>& cost,
                   const ParallelFor& parallel_for) {
  parallel_for(static_cast<int>(individuals.size()), [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      Individual& individual = individuals[static_cast<std::size_t>(i)];
      individual.cost = cost(individual.x);
    }
  });
}

const Individual& BestOf(const std::vector<Individual>& population) {
  return *std::min_element(population.begin(), population.end(),
                           [](const Individual& a, const Individual& b) { return a.cost < b.cost; });
}

}  // namespace

void Visit(OptionVisitor& visitor, EvolutionOptions& options) {
  VisitEnum(visitor, "strategy", options.strategy, kEvolutionStrategyNames,
            "Which vector is changed, by how many differences, and how the result is crossed with its parent.");
  visitor.Integer("population", options.population, "1", 6, 100000,
                  "Number of vectors. More find the optimum more reliably and take more time.");
  visitor.Integer("generations", options.generations, "1", 0, 100000,
                  "Most generations. More are more accurate and take more time.");
  visitor.Real("scale", options.scale, "1", 0.0, 2.0,
               "F, the factor of the differences. A larger one searches more widely and converges later.");
  visitor.Real("crossover", options.crossover, "1", 0.0, 1.0,
               "CR, the probability that a variable comes from the changed vector.");
  visitor.Real("stop_cost", options.stop_cost, "1", -1e12, 1e12, "The search stops below this cost.");
}

EvolutionResult Evolve(const std::function<double(const Eigen::Vector3d&)>& cost, const SearchBox& box,
                       const EvolutionOptions& options, std::mt19937_64& engine, const ParallelFor& parallel_for) {
  const auto size = static_cast<std::size_t>(std::max<std::int64_t>(options.population, 6));
  std::vector<Individual> population(size), trials(size);
  for (std::size_t i = 0; i < size; ++i) {
    for (int n = 0; n < kDimension; ++n) {
      const double share = i == 0 ? 0.5 : Uniform(engine);
      population[i].x(n) = box.min(n) + share * (box.max(n) - box.min(n));
    }
  }
  EvaluateCosts(population, cost, parallel_for);
  Individual best = BestOf(population);

  EvolutionResult result;
  result.evaluations = static_cast<int>(size);
  while (result.generations < options.generations && !(best.cost < options.stop_cost)) {
    for (std::size_t i = 0; i < size; ++i) {
      const int target = static_cast<int>(i);
      const std::array<int, 5> others = DrawOthers(engine, static_cast<int>(size), target);
      const Eigen::Vector3d perturbed = Perturbed(population, others, target, best.x, options);
      const std::array<bool, kDimension> taken = DrawCrossover(engine, options);
      for (int n = 0; n < kDimension; ++n) {
        trials[i].x(n) =
            taken[static_cast<std::size_t>(n)] ? Mirrored(perturbed(n), box.min(n), box.max(n)) : population[i].x(n);
      }
    }
    EvaluateCosts(trials, cost, parallel_for);
    for (std::size_t i = 0; i < size; ++i)
      if (trials[i].cost <= population[i].cost) population[i] = trials[i];
    best = BestOf(population);
    ++result.generations;
    result.evaluations += static_cast<int>(size);
  }
  result.best = best.x;
  result.cost = best.cost;
  result.stop = best.cost < options.stop_cost ? EvolutionStop::kCost : EvolutionStop::kGenerations;
  return result;
}

}  // namespace cairn::slam
