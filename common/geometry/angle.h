// Angles in radians, always compared and stored wrapped to (-pi, pi].
#pragma once

#include <cmath>
#include <numbers>

namespace cairn {

inline constexpr double kPi = std::numbers::pi;

[[nodiscard]] constexpr double Radians(double degrees) {
  return degrees * kPi / 180.0;
}
[[nodiscard]] constexpr double Degrees(double radians) {
  return radians * 180.0 / kPi;
}

// Wraps to (-pi, pi]. Finite input only.
[[nodiscard]] inline double WrapAngle(double angle) {
  if (angle > -kPi && angle <= kPi) return angle;
  const double wrapped = std::remainder(angle, 2.0 * kPi);  // [-pi, pi]
  return wrapped <= -kPi ? kPi : wrapped;
}

// The wrapped turn that leads from b to a.
[[nodiscard]] inline double AngleDiff(double a, double b) {
  return WrapAngle(a - b);
}

// Difference of two undirected line directions, in (-pi/2, pi/2].
[[nodiscard]] inline double LineAngleDiff(double a, double b) {
  double diff = WrapAngle(a - b);
  if (diff > kPi / 2) diff -= kPi;
  if (diff <= -kPi / 2) diff += kPi;
  return diff;
}

}  // namespace cairn
