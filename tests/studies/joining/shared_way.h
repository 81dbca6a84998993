// What the drive of a fleet allows: after which way a robot has driven where robots of the map have driven, however
// good what joins them may be. From the true poses alone. Stateless, deterministic.
#pragma once

#include <vector>

#include "common/sensor/trajectory.h"

namespace cairn::studies {

inline constexpr double kSharedWayM = 15.0;

// The way that a robot has driven until then, in metres. Infinite: never.
struct SharedWay {
  double meets_m = 0.0;   // For the first time within 2 m of where a robot of the map has been.
  double shares_m = 0.0;  // Such places lie kSharedWayM apart along the ways of both.
};

// One per robot. The map begins with the first robot, for which both are 0; another belongs to it as soon as it meets
// it, or shares enough of it.
[[nodiscard]] std::vector<SharedWay> SharedWays(const std::vector<Trajectory>& truths);

}  // namespace cairn::studies
