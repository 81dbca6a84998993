#include "common/sensor/odometry_continuity.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace cairn {
namespace {

// A base that was started again says zero exactly, or has hardly moved since.
constexpr double kZero = 0.02;        // m, rad.
constexpr double kNotFromNear = 0.1;  // m, rad.
constexpr double kGain_m_s = 1.0;     // A robot gets faster by this within a gap.
// Real bases slip and report late: csail's odometry moves by 1.3 m or turns by 1.4 rad within 0.1 s. For so long the
// speed before says nothing.
constexpr double kSlip_rad = 1.5;
constexpr double kLate_s = 0.5;
constexpr double kTurn_rad_s = 4.0;

bool IsWithin(const Pose2& pose, double distance_m, double angle_rad) {
  return pose.translation().norm() <= distance_m && std::abs(pose.theta) <= angle_rad;
}

// After a gap or an unknown time.
bool IsAtSamePlace(const Pose2& before, const Pose2& after, const DriveLimits& limits) {
  return IsWithin(Between(before, after), limits.same_place_m, limits.same_heading_rad);
}

// Whether a pose that the robot has `moved` to is one where odometry begins: at zero, without having been near. A robot
// that comes by has `moved_before`, from sample to sample, as it does now; nothing if that is not known.
bool BeginsAtZero(const Pose2& pose, const Pose2& moved, const std::optional<Pose2>& moved_before) {
  if (!IsWithin(pose, kZero, kZero) || IsWithin(moved, kNotFromNear, kNotFromNear)) return false;
  if (!moved_before) return true;
  // A step of the same drive may be twice as long as the one before, because samples do not come at equal times.
  const double step_m = moved_before->translation().norm(), step_rad = std::abs(moved_before->theta);
  return !IsWithin(moved, step_m + std::max(kNotFromNear, step_m), step_rad + std::max(kNotFromNear, step_rad));
}

// By distance and time. `speed_m_s` is how fast the robot was before, nothing if that is not known.
bool MayBeOneDrive(const Odometry& before, const Odometry& after, std::optional<double> speed_m_s,
                   const DriveLimits& limits) {
  const double passed_s = 1e-9 * static_cast<double>(NanosBetween(before.stamp, after.stamp));
  if (after.stamp < before.stamp || passed_s > limits.max_gap_s)
    return IsAtSamePlace(before.T_odom_robot, after.T_odom_robot, limits);
  const double speed = std::min(limits.max_speed_m_s, speed_m_s.value_or(limits.max_speed_m_s) + kGain_m_s);
  const double late_s = std::min(passed_s, kLate_s);
  const double reach_m = limits.same_place_m + limits.max_speed_m_s * late_s + speed * (passed_s - late_s);
  return IsWithin(Between(before.T_odom_robot, after.T_odom_robot), reach_m, kSlip_rad + kTurn_rad_s * passed_s);
}

// At most max_speed_m_s.
double SpeedBetween(const Odometry& before, const Odometry& after, const DriveLimits& limits) {
  const double passed_s = 1e-9 * static_cast<double>(NanosBetween(before.stamp, after.stamp));
  const double moved_m = Between(before.T_odom_robot, after.T_odom_robot).translation().norm();
  return moved_m >= limits.max_speed_m_s * passed_s ? limits.max_speed_m_s : moved_m / passed_s;
}

}  // namespace

bool GoesOn(const OdometryStep& step, const DriveLimits& limits) {
  std::optional<double> speed_m_s;
  std::optional<Pose2> moved_before;
  if (step.earlier != nullptr) {
    speed_m_s = SpeedBetween(*step.earlier, step.before, limits);
    moved_before = Between(step.earlier->T_odom_robot, step.before.T_odom_robot);
  }
  const Pose2& before = step.before.T_odom_robot;
  const Pose2& after = step.after.T_odom_robot;
  if (BeginsAtZero(step.logged, Between(before, after), moved_before)) return false;
  return step.time_known ? MayBeOneDrive(step.before, step.after, speed_m_s, limits)
                         : IsAtSamePlace(before, after, limits);
}

}  // namespace cairn
