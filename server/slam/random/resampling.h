// The weights of a particle set: normalisation, effective sample size and resampling.
// Source: stratified resampling, thesis A Table 4.9 (which adds the cumulative sum twice; here it is added
// once); effective sample size of Liu 1996.
#pragma once

#include <span>
#include <vector>

#include "server/slam/random/draws.h"

namespace cairn::slam {

// Converts log weights to weights that sum to 1. All are equal if no log weight is finite.
[[nodiscard]] std::vector<double> NormalisedWeights(std::span<const double> log_weights);

// 1 / sum(w^2), which lies between 1 and the number of particles.
[[nodiscard]] double EffectiveSampleSize(std::span<const double> weights);

// Draws weights.size() survivors, one in each of as many equal strata. Returns the parent of each survivor,
// in ascending order.
[[nodiscard]] std::vector<int> StratifiedSurvivors(std::span<const double> weights, Rng& rng);

// Returns the set after resampling: a copy of each survivor's parent, in order.
template <typename Item>
[[nodiscard]] std::vector<Item> Resampled(const std::vector<Item>& items, std::span<const int> parents) {
  std::vector<Item> resampled;
  resampled.reserve(parents.size());
  for (const int parent : parents) resampled.push_back(items[static_cast<std::size_t>(parent)]);
  return resampled;
}

// The share of all pairs of survivors that have the same parent. It is the share of the spread of a set that
// resampling removes.
// REQUIRES: parents ascending.
[[nodiscard]] double SharedParentFraction(std::span<const int> parents);

}  // namespace cairn::slam
