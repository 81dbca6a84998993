// The interval in which the mean NEES of independent errors lies if their covariance is right. The same
// interval around a known wrong value checks that value from both sides. Source: Bar-Shalom, Li, Kirubarajan
// 2001, 5.4.
#pragma once

#include "server/slam/landmarks/innovation.h"

namespace cairn::slam::test {

struct NeesBounds {
  double low = 0.0;
  double high = 0.0;
};

// With probability 99 %, the mean NEES of `runs` errors of three numbers lies between these bounds, times
// `value` / 3.
inline NeesBounds NeesBoundsOf(int runs, double value = 3.0) {
  const double numbers = 3.0 * runs;
  return {value * ChiSquareQuantile(0.005, numbers) / numbers, value * ChiSquareQuantile(0.995, numbers) / numbers};
}

}  // namespace cairn::slam::test
