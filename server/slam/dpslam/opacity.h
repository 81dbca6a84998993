// The opacity model of a grid cell: a laser beam that travels x through a cell of opacity rho is stopped
// there with probability 1 - exp(-x / rho). A cell holds how far beams have travelled in it and how often
// they were stopped. Its opacity is the ratio of the two, the maximum likelihood estimate, with a small prior
// so that unseen cells sometimes stop a ray.
// The computation along a ray is in ray_likelihood.h; its test contains the textbook form, (3.36)-(3.39).
// Metres. Stateless, thread-safe. Source: Eliazar, Parr 2004 (DP-SLAM 2.0); thesis C 3.2.3.1, (3.35)-(3.39).
// Corrected: the sum of (3.36) is over i with the probability of reaching cell i - 1. "The weight of an
// entire scan is the sum of all ray weights" is wrong: rays are independent given pose and map, so their
// likelihoods multiply (their logarithms are added).
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::slam {

struct OpacityOptions {
  double resolution_m = 0.05;
  double max_ray_m = 20.0;
  double no_return_m = 20.0;
  double prior_stops = 0.02;
  // prior_stops / prior_distance_m is the number of stops per metre in unknown space.
  double prior_distance_m = 0.06;
  std::int64_t max_rays = 361;
};
void Visit(OptionVisitor& visitor, OpacityOptions& options);

// Travel is counted in steps of 1/32 of a cell's width.
inline constexpr double kTravelPerCell = 32.0;

struct CellCounts {
  std::uint32_t travel = 0;  // Laser distance through the cell, in 1/32 of its width.
  std::uint32_t stops = 0;
  bool operator==(const CellCounts&) const = default;
};

// Stops per cell-width of travel: the reciprocal of opacity, in cells.
struct StopRate {
  explicit StopRate(const OpacityOptions& options);
  [[nodiscard]] float operator()(const CellCounts& counts) const {
    return (static_cast<float>(counts.stops) + prior_stops) /
           (static_cast<float>(counts.travel) * static_cast<float>(1.0 / kTravelPerCell) + prior_cells);
  }
  float prior_stops;
  float prior_cells;
};

// The probability that a ray is stopped within a cell in which it travels this far, (3.35).
[[nodiscard]] double StopProbability(double length_m, double opacity_m);

}  // namespace cairn::slam
