// The motion of a robot that drives `way_m` along a circular arc while it turns by `turn_rad`: T_start_end.
// Exact for constant wheel speeds. Source: Siegwart, Nourbakhsh, Scaramuzza 2011, section 5.2.4.
#pragma once

#include <cmath>

#include "common/geometry/pose2.h"

namespace cairn::sim {

[[nodiscard]] inline Pose2 DriveArc(double way_m, double turn_rad) {
  const double half = turn_rad / 2;
  const double chord = std::abs(half) < 1e-6 ? way_m * (1.0 - half * half / 6.0) : way_m * std::sin(half) / half;
  return {chord * std::cos(half), chord * std::sin(half), WrapAngle(turn_rad)};
}

}  // namespace cairn::sim
