// The control of the velocity model: an arc, then a turn on the spot. The control is the step itself:
// velocities are per step, so the time between keyframes is 1. Stateless, thread-safe.
// Source: thesis C 4.2, Table 4.1; Thrun et al. 2005, Table 5.3.
#pragma once

#include "common/geometry/pose2.h"

namespace cairn::slam {

// An arc of length v that turns by w, then a turn by g on the spot. A negative v means backwards. m, rad.
struct VelocityControl {
  double v = 0.0, w = 0.0, g = 0.0;
};
// Returns the control that leads exactly to this step.
[[nodiscard]] VelocityControl InverseVelocity(const Pose2& T_prev_curr);
// Lines 4-6 of Table 4.1.
[[nodiscard]] Pose2 ApplyVelocity(const Pose2& T_map_robot, const VelocityControl& control);

}  // namespace cairn::slam
