// Robots of a simulated fleet whose starts nobody knows: whether they are joined where they truly are.
#pragma once

#include <cstdint>

#include "server/slam/mapper_options.h"
#include "tests/studies/mapper/mapper_consistency.h"

namespace cairn::studies {

struct FleetJoin {
  int robots = 0;
  int joined = 0;  // To another robot's frame, or with others in their own.
  // Of these: more than 0.5 m or 0.1 rad from the true place, seen from the others where these have been.
  int wrong = 0;
  double error_m = 0.0;                 // Mean distance of those that are not wrong.
  double most_m = 0.0, most_rad = 0.0;  // Of the joined robot that is farthest from its place, and most turned.
};

struct FleetJoins {
  FleetJoin together;   // All are smoothed together.
  FleetJoin fragments;  // The first one begins the map, and a join job looks for the others in it.
};

// Three robots drive through a world.
[[nodiscard]] FleetJoins JoinFleet(const ConsistencyDrive& drive, const slam::MapperOptions& options,
                                   std::uint64_t seed);

}  // namespace cairn::studies
