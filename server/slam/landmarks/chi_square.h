// Quantiles of the chi-square distribution, which bound a squared Mahalanobis distance or a sum of them.
#pragma once

namespace cairn::slam {

// The x with P(X <= x) = share, for `numbers` degrees of freedom. REQUIRES: 0 < share < 1, numbers > 0.
[[nodiscard]] double ChiSquareQuantile(double share, double numbers);

// P(X <= x): the regularised lower incomplete gamma function of numbers / 2 and x / 2.
[[nodiscard]] double ChiSquareShare(double x, double numbers);

}  // namespace cairn::slam
