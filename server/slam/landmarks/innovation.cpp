#include "server/slam/landmarks/innovation.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {

// Computed by the series of the incomplete gamma function.
double ChiSquareShare(double x, double numbers) {
  if (!(x > 0.0)) return 0.0;
  const double a = 0.5 * numbers, half = 0.5 * x;
  if (half > a + 40.0 + 12.0 * std::sqrt(a)) return 1.0;
  double term = 1.0 / a, sum = term;
  for (double n = a + 1.0; term > sum * 1e-15; n += 1.0) {
    term *= half / n;
    sum += term;
  }
  // std::lgamma is not used, because it writes a global variable (the sign). Stirling's series is exact
  // enough after the argument was shifted to at least 20.
  double shift = 0.0, z = a;
  for (; z < 20.0; z += 1.0) shift += std::log(z);
  const double log_gamma = (z - 0.5) * std::log(z) - z + 0.91893853320467274 + 1.0 / (12.0 * z) -
                           1.0 / (360.0 * z * z * z) + 1.0 / (1260.0 * std::pow(z, 5)) - shift;
  return std::min(1.0, sum * std::exp(a * std::log(half) - half - log_gamma));
}

double ChiSquareQuantile(double share, double numbers) {
  // Bisection: the function is monotone, the bounds always enclose the solution, and no derivative is needed.
  double low = 0.0, high = numbers + 10.0;
  while (ChiSquareShare(high, numbers) < share) high *= 2.0;
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (ChiSquareShare(middle, numbers) < share ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace cairn::slam
