// Differential evolution: finds the minimum of a function of three variables inside a box with a population
// of trial vectors, without derivatives and without an initial guess. The meaning of the variables is left to
// the caller (ndt_de).
// Random numbers are drawn in the calling thread only, and a whole generation is evaluated at once, so that
// the result does not depend on how the evaluation is spread over threads. Stateless, thread-safe.
// Source: Storn and Price 1997 and the ten strategies of their program de36.c; thesis C 2.4.5-2.4.6.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <string_view>

#include "common/options/option_visitor.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

// Which vector is perturbed, by how many differences, and how the result is crossed with its parent:
// exponentially (a run of neighbouring variables) or binomially (each variable by itself). The order is that
// of thesis C 2.4.6.
enum class EvolutionStrategy : std::uint8_t {
  kBest1Exp = 0,
  kRand1Exp,
  kRandToBest1Exp,
  kBest2Exp,
  kRand2Exp,
  kBest1Bin,
  kRand1Bin,
  kRandToBest1Bin,
  kBest2Bin,
  kRand2Bin
};
inline constexpr std::array<std::string_view, 10> kEvolutionStrategyNames = {
    "best_1_exp", "rand_1_exp", "rand_to_best_1_exp", "best_2_exp", "rand_2_exp",
    "best_1_bin", "rand_1_bin", "rand_to_best_1_bin", "best_2_bin", "rand_2_bin"};

// The defaults are those of thesis C Table 4.5 and 4.4.1. The thesis does not state which strategy it used.
struct EvolutionOptions {
  EvolutionStrategy strategy = EvolutionStrategy::kRandToBest1Exp;
  std::int64_t population = 100;  // NP: size of the population.
  std::int64_t generations = 50;
  double scale = 1.0;
  double crossover = 0.95;
  double stop_cost = 1.0;
};
void Visit(OptionVisitor& visitor, EvolutionOptions& options);

struct SearchBox {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
};

enum class EvolutionStop : std::uint8_t { kCost, kGenerations };

struct EvolutionResult {
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  double cost = 0.0;
  int generations = 0;  // Generations computed; 0 if the first random population was good enough.
  int evaluations = 0;
  EvolutionStop stop = EvolutionStop::kGenerations;
};

// `cost` is called from several threads at once. REQUIRES: box.min <= box.max, population >= 6.
// The first vector is the middle of the box, the others are uniformly distributed in it. Trial vectors that
// leave the box are mirrored at its sides: the thesis limits the result to its search space (Table 4.4) and
// does not state how.
[[nodiscard]] EvolutionResult Evolve(const std::function<double(const Eigen::Vector3d&)>& cost, const SearchBox& box,
                                     const EvolutionOptions& options, std::mt19937_64& engine,
                                     const ParallelFor& parallel_for);

}  // namespace cairn::slam
