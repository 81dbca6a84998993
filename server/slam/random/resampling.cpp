#include "server/slam/random/resampling.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/geometry/angle.h"

namespace cairn::slam {

std::vector<double> NormalisedWeights(std::span<const double> log_weights) {
  std::vector<double> weights(log_weights.size(), 0.0);
  double top = -std::numeric_limits<double>::infinity();
  for (const double w : log_weights)
    if (std::isfinite(w)) top = std::max(top, w);
  double sum = 0.0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (std::isfinite(log_weights[i])) weights[i] = std::exp(log_weights[i] - top);
    sum += weights[i];
  }
  const double equal = 1.0 / static_cast<double>(std::max<std::size_t>(weights.size(), 1));
  for (double& w : weights) w = sum > 0.0 ? w / sum : equal;
  return weights;
}

double EffectiveSampleSize(std::span<const double> weights) {
  double squares = 0.0;
  for (const double w : weights) squares += w * w;
  return squares > 0.0 ? 1.0 / squares : 0.0;
}

std::vector<int> StratifiedSurvivors(std::span<const double> weights, Rng& rng) {
  const std::size_t n = weights.size();
  std::vector<int> survivors;
  survivors.reserve(n);
  std::size_t parent = 0;
  double cumulative = n > 0 ? weights[0] : 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double draw = (static_cast<double>(i) + UniformDraw(rng)) / static_cast<double>(n);
    while (draw > cumulative && parent + 1 < n) cumulative += weights[++parent];
    survivors.push_back(static_cast<int>(parent));
  }
  return survivors;
}

double SharedParentFraction(std::span<const int> parents) {
  const auto n = static_cast<double>(parents.size());
  double pairs = 0.0, earlier = 0.0;  // `earlier` counts the earlier survivors of the same parent.
  for (std::size_t i = 1; i < parents.size(); ++i) {
    earlier = parents[i] == parents[i - 1] ? earlier + 1.0 : 0.0;
    pairs += earlier;
  }
  return n > 1.0 ? 2.0 * pairs / (n * (n - 1.0)) : 1.0;
}

}  // namespace cairn::slam
