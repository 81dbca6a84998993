// How the robot moved while a scan was taken, as samples of odometry from which Deskew (deskew.h) takes the motion out
// of the scan. Usually they are odometry itself; the functions here make them where odometry is not used, or
// where the match of the scan has shown that odometry is wrong. Poses are in any fixed frame. Stateless, thread-safe.
#pragma once

#include <memory>
#include <vector>

#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"

namespace cairn::slam {

// A scan whose beams were measured one after the other, as it was measured, and the odometry meanwhile: from the last
// sample at or before its stamp to the first one at or after its last beam.
struct RollingScan {
  std::shared_ptr<const Scan> scan;
  std::vector<Odometry> odometry;
};

// The motion while the scan is taken if the robot goes on as in the `seconds` (> 0) in which it made `step`.
[[nodiscard]] std::vector<Odometry> AtConstantVelocity(const Scan& scan, const Pose2& step, double seconds);

// The motion that odometry shows while the scan is taken, if odometry goes on to miss what it missed in the `seconds`
// (> 0) in which the robot moved by `step` and odometry by `odometry_step`.
[[nodiscard]] std::vector<Odometry> CorrectedMotion(const RollingScan& rolling, const Pose2& step,
                                                    const Pose2& odometry_step, double seconds);

// How far the second motion moves the last beam's lidar pose away from where the first one has it.
[[nodiscard]] Pose2 DifferenceAtTheEnd(const std::vector<Odometry>& a, const std::vector<Odometry>& b);

}  // namespace cairn::slam
