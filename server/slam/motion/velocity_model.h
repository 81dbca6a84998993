// The velocity model's control: an arc, then a turn on the spot. A control is the step itself: velocities per step, so
// the time between keyframes is 1. Stateless, thread-safe. Source: thesis C 4.2, Table 4.1; Thrun et al. 2005,
// Table 5.3.
#pragma once

#include "common/geometry/pose2.h"

namespace cairn::slam {

// An arc of length v that turns by w, then a turn g on the spot; v < 0: backwards.
struct VelocityControl {
  double v = 0.0, w = 0.0, g = 0.0;
};
// The control that makes the step exactly.
[[nodiscard]] VelocityControl InverseVelocity(const Pose2& T_prev_curr);
[[nodiscard]] Pose2 ApplyVelocity(const Pose2& T_map_robot, const VelocityControl& control);  // Lines 4-6.

}  // namespace cairn::slam
