// The opacity model of a grid cell: a laser that travels x through a cell of opacity rho is stopped there with
// probability 1 - exp(-x / rho). A cell holds how far laser has travelled in it and how often it was stopped; opacity
// is their ratio, the maximum likelihood estimate, with a small prior so that cells never seen stop a ray now and then.
// This file is the textbook: the fast walk through a map is ray_likelihood.h, tested against it.
// Metres. Stateless, thread-safe. Source: Eliazar, Parr 2004 (DP-SLAM 2.0); thesis C 3.2.3.1, (3.35)-(3.39).
// Put right: the sum of (3.36) is over i with the reach of i - 1; and "the weight of an entire scan is the sum of all
// ray weights" is a slip: rays are independent given pose and map, so their likelihoods multiply (their logarithms add
// up).
#pragma once

#include <cstdint>
#include <span>

#include "common/options/option_visitor.h"

namespace cairn::slam {

struct OpacityOptions {
  double resolution_m = 0.05;
  double max_ray_m = 20.0;         // Rays are cut here: what is hit farther away only says "passed".
  double no_return_m = 20.0;       // How far a beam that hit nothing is believed to have passed; 0: it says nothing.
  double prior_stops = 0.02;       // Stops and distance a cell has before it is seen. Their ratio is how often
  double prior_distance_m = 0.06;  // unknown space stops a ray per metre; both larger: slower learning.
  std::int64_t max_rays = 361;     // Of a scan, evenly picked where it has more.
};
void Visit(OptionVisitor& visitor, OpacityOptions& options);

// Cell-widths of travel are counted in steps of 1/32.
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

// What a ray meets on its way, cell by cell.
struct RaySpan {
  double length_m = 0.0;   // x_i
  double opacity_m = 0.0;  // rho_i
  double delta_m = 0.0;    // From the measured end to the cell, along the ray.
};

[[nodiscard]] double StopProbability(double length_m, double opacity_m);                // (3.35)
[[nodiscard]] double StoppedProbability(std::span<const RaySpan> spans);                // (3.36)
[[nodiscard]] double StopProbabilityAt(std::span<const RaySpan> spans, std::size_t j);  // (3.37)
[[nodiscard]] double MeasurementDensity(double delta_m, double sigma_m);                // (3.38)
[[nodiscard]] double RayDensity(std::span<const RaySpan> spans, double sigma_m);        // (3.39)

}  // namespace cairn::slam
