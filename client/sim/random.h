// The random engine of the simulator. It is always handed in, never made inside a model: same seed, same world.
#pragma once

#include <random>

namespace cairn::sim {

using Random = std::mt19937_64;

// A normal draw of mean 0; no draw at all where sigma is 0.
[[nodiscard]] inline double Normal(Random& random, double sigma) {
  return sigma > 0.0 ? std::normal_distribution<double>(0.0, sigma)(random) : 0.0;
}

}  // namespace cairn::sim
