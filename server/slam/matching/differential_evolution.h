// Differential evolution: finds the least value of a function of three variables inside a box by breeding a population
// of trial vectors, without derivatives and without a guess. Not tied to what the variables mean; ndt_de gives them
// one. The engine draws in the calling thread only, and a whole generation is judged at once, so the answer does not
// depend on how the judging is spread over threads. Stateless, thread-safe. Source: Storn and Price 1997 and the ten
// strategies of their program de36.c; thesis C 2.4.5-2.4.6.
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

// Which vector is perturbed, by how many differences, and how the result is crossed with its parent: exponentially (a
// run of neighbouring variables) or binomially (each variable by itself). In the order of thesis C 2.4.6.
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

// Defaults: thesis C Table 4.5 and 4.4.1. The thesis does not say which strategy it used.
struct EvolutionOptions {
  EvolutionStrategy strategy = EvolutionStrategy::kRandToBest1Exp;
  std::int64_t population = 100;  // NP. More: surer to find the right basin, in proportionally more time.
  std::int64_t generations = 50;  // More: finer.
  double scale = 1.0;             // F, of the differences. Larger: searches wider, settles later.
  double crossover = 0.95;        // CR, chance that a variable comes from the perturbed vector.
  double stop_cost = 1.0;         // Stops below it.
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
  int generations = 0;  // Bred; 0 where the first random population was good enough.
  int evaluations = 0;
  EvolutionStop stop = EvolutionStop::kGenerations;
};

// `cost` is called from several threads at once. REQUIRES: box.min <= box.max, population >= 6.
// The first vector is the middle of the box, the others are drawn evenly from it. Trials that leave the box are
// mirrored at its sides: the thesis limits the answer to its search space (Table 4.4) and does not say how.
[[nodiscard]] EvolutionResult Evolve(const std::function<double(const Eigen::Vector3d&)>& cost, const SearchBox& box,
                                     const EvolutionOptions& options, std::mt19937_64& engine,
                                     const ParallelFor& parallel_for);

}  // namespace cairn::slam
