#include "server/slam/calibration/differential_drive.h"

#include <cmath>

namespace cairn::slam {

void Visit(OptionVisitor& visitor, DifferentialDrive& drive) {
  visitor.Real("base_m", drive.base_m, "m", 0.01, 10.0,
               "Distance between the points where the wheels touch the ground.");
  visitor.Real("left_diameter_m", drive.left_diameter_m, "m", 0.001, 10.0, "Diameter of the left wheel.");
  visitor.Real("right_diameter_m", drive.right_diameter_m, "m", 0.001, 10.0, "Diameter of the right wheel.");
  visitor.Real("pulses_per_turn", drive.pulses_per_turn, "1", 1.0, 1e9,
               "Pulses of the encoder in one turn of a wheel.");
}

WheelTravel TravelOfPulses(double left_pulses, double right_pulses, const DifferentialDrive& drive) {
  return {kPi * drive.left_diameter_m / drive.pulses_per_turn * left_pulses,
          kPi * drive.right_diameter_m / drive.pulses_per_turn * right_pulses};
}

Pose2 MotionOfTravel(const WheelTravel& travel, double base_m) {
  const double way = (travel.right_m + travel.left_m) / 2;
  const double turn = (travel.right_m - travel.left_m) / base_m;
  const double half = turn / 2;
  // sin(half) / half; near zero its series, because the quotient would lose digits.
  const double chord = std::abs(half) < 1e-6 ? way * (1.0 - half * half / 6.0) : way * std::sin(half) / half;
  return {chord * std::cos(half), chord * std::sin(half), WrapAngle(turn)};
}

WheelTravel TravelOfArc(double way_m, double turn_rad, double base_m) {
  return {way_m - turn_rad * base_m / 2, way_m + turn_rad * base_m / 2};
}

}  // namespace cairn::slam
