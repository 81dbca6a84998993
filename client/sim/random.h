// The random engine of the simulator. It is always handed in, never made inside a model: same seed, same world.
// The draws are written out here, because a standard library may define its distributions as it likes: the same seed
// gives the same world with every compiler and standard library.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>

namespace cairn::sim {

using Random = std::mt19937_64;

// Uniform in [0, 1).
[[nodiscard]] inline double Uniform(Random& random) {
  return std::min(static_cast<double>(random()) * 0x1.0p-64, 1.0 - 0x1.0p-53);  // The greatest values round up to 1.
}

// A normal draw of mean 0; no draw at all where sigma is 0. Source: Marsaglia and Bray 1964, the polar method.
[[nodiscard]] inline double Normal(Random& random, double sigma) {
  if (!(sigma > 0.0)) return 0.0;
  double x = 0.0, y = 0.0, square = 0.0;
  do {
    x = 2.0 * Uniform(random) - 1.0;
    y = 2.0 * Uniform(random) - 1.0;
    square = x * x + y * y;
  } while (square > 1.0 || square == 0.0);
  return y * std::sqrt(-2.0 * std::log(square) / square) * sigma;
}

}  // namespace cairn::sim
