// Furniture that stands elsewhere with another seed, for runs in a place that has changed since the last one. Round
// pieces, higher than any laser, at random places beside the routes, where a robot that drives there can see them and
// does not run into them. Deterministic.
#pragma once

#include <cstdint>
#include <vector>

#include "client/sim/scene.h"
#include "common/status.h"

namespace cairn::sim {

struct FurnitureOptions {
  int pieces = 0;  // 0..1000. Fewer stand in a place that has no room for them.
  std::uint64_t seed = 1;
};
[[nodiscard]] Result<void> Validate(const FurnitureOptions& options);

// The new pieces alone. REQUIRES: the place has a route, and no furniture of another call.
[[nodiscard]] std::vector<Post> FurnitureIn(const Surroundings& place, const FurnitureOptions& options);

}  // namespace cairn::sim
