// Maximum likelihood estimate of the spread of zero-mean normal errors whose variance, or whose standard
// deviation, is linear in two known regressors. Both estimates use Fisher scoring (repeated weighted least
// squares), with no parameter below a bound.
// Stateless, thread-safe. Source: Eliazar, Parr, ICML 2004, section 4.2 (variances); McCullagh, Nelder 1989,
// 2.5.
#pragma once

#include <Eigen/Core>
#include <span>

namespace cairn::slam {

struct SpreadSample {
  double first = 0.0;  // The two regressors, both >= 0.
  double second = 0.0;
  double square = 0.0;  // Square of the error (or its expectation).
  double weight = 1.0;  // Weight of the sample.
};

// Model: variance = v(0) first + v(1) second + constant. Returns v, each element at least `least` (> 0).
[[nodiscard]] Eigen::Vector2d FitVariance(std::span<const SpreadSample> samples, const Eigen::Vector2d& start,
                                          double constant, double least);

// Model: sigma = s(0) first + s(1) second. Returns s, each element at least `least` (> 0).
[[nodiscard]] Eigen::Vector2d FitSigma(std::span<const SpreadSample> samples, const Eigen::Vector2d& start,
                                       double least);

}  // namespace cairn::slam
