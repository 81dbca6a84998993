// The textbook form of the likelihood of a ray, against which the fast form is tested (ray_likelihood.h).
// Source: Eliazar, Parr 2004 (DP-SLAM 2.0); thesis C 3.2.3.1, (3.36)-(3.39).
#pragma once

#include <cmath>
#include <span>

#include "common/geometry/angle.h"
#include "server/slam/dpslam/opacity.h"

namespace cairn::slam {

// The part of a ray in one cell.
struct RaySpan {
  double length_m = 0.0;   // x_i: length in the cell.
  double opacity_m = 0.0;  // rho_i: opacity of the cell.
  double delta_m = 0.0;    // Distance from the measured end to the cell, along the ray.
};

// (3.37)
[[nodiscard]] inline double StopProbabilityAt(std::span<const RaySpan> spans, std::size_t j) {
  double reach = 1.0;
  for (std::size_t i = 0; i < j; ++i) reach *= 1.0 - StopProbability(spans[i].length_m, spans[i].opacity_m);
  return reach * StopProbability(spans[j].length_m, spans[j].opacity_m);
}

// (3.36)
[[nodiscard]] inline double StoppedProbability(std::span<const RaySpan> spans) {
  double stopped = 0.0;
  for (std::size_t i = 0; i < spans.size(); ++i) stopped += StopProbabilityAt(spans, i);
  return stopped;
}

// (3.38)
[[nodiscard]] inline double MeasurementDensity(double delta_m, double sigma_m) {
  const double z = delta_m / sigma_m;
  return std::exp(-0.5 * z * z) / (sigma_m * std::sqrt(2.0 * kPi));
}

// (3.39)
[[nodiscard]] inline double RayDensity(std::span<const RaySpan> spans, double sigma_m) {
  double density = 0.0;
  for (std::size_t i = 0; i < spans.size(); ++i)
    density += MeasurementDensity(spans[i].delta_m, sigma_m) * StopProbabilityAt(spans, i);
  return density;
}

}  // namespace cairn::slam
