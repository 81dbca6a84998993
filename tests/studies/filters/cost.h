// What it costs a filter to see landmarks again, against how many it holds: a filter driven twice round a ring of
// corners, the second round timed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/slam/filters/make_filter.h"

namespace cairn::studies {

struct CostPoint {
  std::size_t landmarks = 0;  // Held after the second round.
  double step_ms = 0.0;       // Processor time of a step of the second round, mean.
};

// Of the power law through the points: 2 where the cost grows with the square of the landmarks.
[[nodiscard]] double CostExponent(const std::vector<CostPoint>& points);

// A ring of `corners`, two every 1.5 m of the way. Deterministic but for the times.
[[nodiscard]] CostPoint StudyCost(slam::FilterKind kind, std::size_t corners, std::uint64_t seed);

}  // namespace cairn::studies
