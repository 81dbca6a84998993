// Whether odometry goes on, or has begun anew: the base of a robot was started again, or set to another pose. The poses
// before and after that cannot be joined. The estimator asks this of what it receives, and a robot's client of what it
// sends, because it must not give a start pose that it does not know. Pure functions.
#pragma once

#include <optional>

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

// After a gap or an unknown time.
[[nodiscard]] bool IsAtSamePlace(const Pose2& before, const Pose2& after, const DriveLimits& limits = {});

// Two samples of odometry, one after the other.
struct OdometryStep {
  const Odometry* earlier = nullptr;  // The one before `before`, if it is known to be of the same drive.
  const Odometry& before;
  const Odometry& after;
  const Pose2& logged;     // Of `after`, as the base has sent it, where `after` was corrected.
  bool time_known = true;  // Whether the stamps of `before` and `after` are of the same clock.
};

// Whether odometry goes on with this step. The functions below are its parts.
[[nodiscard]] bool GoesOn(const OdometryStep& step, const DriveLimits& limits = {});

// Whether a pose that the robot has `moved` to is one where odometry begins: at zero, without having been near. A robot
// that comes by has `moved_before`, from sample to sample, as it does now; nothing if that is not known.
[[nodiscard]] bool BeginsAtZero(const Pose2& pose, const Pose2& moved, const std::optional<Pose2>& moved_before);

// Whether two successive samples may belong to one drive, by their distance. `speed_m_s` is how fast the robot
// was before, nothing if that is not known: a robot that stood is not four metres away after a gap of 1.5 s.
[[nodiscard]] bool MayBeOneDrive(const Odometry& before, const Odometry& after, std::optional<double> speed_m_s,
                                 const DriveLimits& limits = {});

// The speed between two samples, at most max_speed_m_s.
[[nodiscard]] double SpeedBetween(const Odometry& before, const Odometry& after, const DriveLimits& limits = {});

}  // namespace cairn
