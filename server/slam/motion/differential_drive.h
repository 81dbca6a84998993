// The odometry of a differential drive: wheel pulses to wheel travel to motion, and what a motion asks of the wheels.
// Not a dynamic model: no slip, no limits. Metres and radians; motions are T_prev_curr in the robot frame, whose origin
// lies midway between the wheels. Stateless, thread-safe.
// Source: thesis B 3.3, (3.2)..(3.6). (3.6) advances along the heading after the step; here the step is the exact arc
// of constant wheel speeds (Siegwart et al. 2011, 5.2.4), which does not depend on how finely the motion is cut.
#pragma once

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct DifferentialDrive {
  double base_m = 0.34;            // b: between the points where the wheels touch the ground.
  double left_diameter_m = 0.20;   // D_L
  double right_diameter_m = 0.20;  // D_R
  double pulses_per_turn = 2048;   // n * C_e: encoder pulses in one turn of a wheel.
};
void Visit(OptionVisitor& visitor, DifferentialDrive& drive);

struct WheelTravel {
  double left_m = 0.0;
  double right_m = 0.0;
};

// (3.2), (3.3).
[[nodiscard]] WheelTravel TravelOfPulses(double left_pulses, double right_pulses, const DifferentialDrive& drive);

// (3.4)..(3.6): T_prev_curr.
[[nodiscard]] Pose2 MotionOfTravel(const WheelTravel& travel, double base_m);

// The wheel travel of an arc of length `way_m` on which the robot turns by `turn_rad`: MotionOfTravel's inverse.
[[nodiscard]] WheelTravel TravelOfArc(double way_m, double turn_rad, double base_m);

}  // namespace cairn::slam
