// Weights of a particle set: normalising, how many particles still count, and which survive.
// Source: stratified resampling, thesis A Table 4.9 (which adds the cumulative sum twice: here once); effective sample
// size of Liu 1996.
#pragma once

#include <random>
#include <span>
#include <vector>

namespace cairn::slam {

using Rng = std::mt19937_64;

// Log weights to weights that sum to 1; all equal where no weight is finite.
[[nodiscard]] std::vector<double> NormalisedWeights(std::span<const double> log_weights);

// 1 / sum(w^2): between 1 and the number of particles.
[[nodiscard]] double EffectiveSampleSize(std::span<const double> weights);

// The parent of each of weights.size() survivors, in ascending order; one draw in each of n equal strata.
[[nodiscard]] std::vector<int> StratifiedSurvivors(std::span<const double> weights, Rng& rng);

// How many pairs of survivors have the same parent, of all pairs: what resampling takes off the spread of a set.
// REQUIRES: parents ascending.
[[nodiscard]] double ShareOfSiblings(std::span<const int> parents);

// Uniform in [0, 1) and standard normal with a definition of our own, so that every standard library gives the same.
[[nodiscard]] double UniformDraw(Rng& rng);
[[nodiscard]] double NormalDraw(Rng& rng);

}  // namespace cairn::slam
