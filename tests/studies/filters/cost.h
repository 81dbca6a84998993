// The computing time that a filter needs to see landmarks again, against the number of its landmarks. The
// filter is driven twice round a ring of corners, and the second round is timed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/slam/methods.h"

namespace cairn::studies {

struct CostPoint {
  std::size_t landmarks = 0;  // Number of landmarks after the second round.
  double step_ms = 0.0;       // Processor time of a step of the second round, mean.
};

// Exponent of the power law through the points: 2 if the cost grows with the square of the number of
// landmarks.
[[nodiscard]] double CostExponent(const std::vector<CostPoint>& points);

// A ring of `corners`, two for every 1.5 m of the path. Deterministic except for the times.
[[nodiscard]] CostPoint StudyCost(slam::FilterKind kind, std::size_t corners, std::uint64_t seed);

}  // namespace cairn::studies
