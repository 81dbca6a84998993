// Whether odometry goes on, or has begun anew: the base of a robot was started again, or set to another pose. The poses
// before and after that cannot be joined. The estimator asks this of what it receives, and a robot's client of what it
// sends, because it must not give a start pose that it does not know. A pure function.
#pragma once

#include "common/sensor/odometry.h"

namespace cairn {

struct DriveLimits {
  double max_gap_s = 2.0;
  double max_speed_m_s = 3.0;
  // After a longer gap, or an unknown time, odometry goes on only if it has changed by less than this. A robot that was
  // switched off for a night may have driven anywhere; its odometry would be plausible after any distance.
  double same_place_m = 1.0;
  double same_heading_rad = 1.0;
};

// Two samples of odometry, one after the other.
struct OdometryStep {
  const Odometry* earlier = nullptr;  // The one before `before`, if it is known to be of the same drive.
  const Odometry& before;
  const Odometry& after;
  const Pose2& logged;     // The pose of `after` before any correction of the wheels.
  bool time_known = true;  // Whether the stamps of `before` and `after` are of the same clock.
};

// Whether odometry goes on with this step. It has begun anew where `after` is at zero and the robot was not near, where
// no robot could have come so far in the time between, and, where the time is unknown or longer than max_gap_s, where
// the robot is somewhere else. How fast it was before counts, if that is known: a robot that stood is not four metres
// away after a gap of 1.5 s.
[[nodiscard]] bool GoesOn(const OdometryStep& step, const DriveLimits& limits = {});

}  // namespace cairn
