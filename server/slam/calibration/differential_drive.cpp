#include "server/slam/calibration/differential_drive.h"

#include <cmath>

namespace cairn::slam {

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
