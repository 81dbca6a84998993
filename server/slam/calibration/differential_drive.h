// The odometry of a differential drive: from wheel travel to the robot's motion and back. Not a dynamic model: it has
// no slip and no limits. Metres and radians. Motions are T_prev_curr in the robot frame, whose origin lies midway
// between the wheels. Stateless, thread-safe. Source: thesis B 3.3, (3.4)..(3.6). (3.6) advances along the heading
// after the step; here the step is the exact arc of constant wheel speeds (Siegwart et al. 2011, 5.2.4), which does not
// depend on how finely the motion is cut.
#pragma once

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct DifferentialDrive {
  // b: distance between the points where the wheels touch the ground.
  double base_m = 0.34;
  double left_diameter_m = 0.20;   // D_L: diameter of the left wheel.
  double right_diameter_m = 0.20;  // D_R: diameter of the right wheel.
};

struct WheelTravel {
  double left_m = 0.0;
  double right_m = 0.0;
};

// Motion T_prev_curr from wheel travel, (3.4)..(3.6).
[[nodiscard]] Pose2 MotionOfTravel(const WheelTravel& travel, double base_m);

// The wheel travel of an arc of length `way_m` on which the robot turns by `turn_rad`. Inverse of
// MotionOfTravel.
[[nodiscard]] WheelTravel TravelOfArc(double way_m, double turn_rad, double base_m);

}  // namespace cairn::slam
