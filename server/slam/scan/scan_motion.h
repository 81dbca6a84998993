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

// The motion that odometry shows while the scan is taken, if the rate of its error stays as in the last `seconds` (>
// 0), in which the robot moved by `step` and odometry by `odometry_step`.
[[nodiscard]] std::vector<Odometry> CorrectedMotion(const RollingScan& rolling, const Pose2& step,
                                                    const Pose2& odometry_step, double seconds);

// The pose of the robot at the last sample of the second motion, seen from that of the first one.
[[nodiscard]] Pose2 DifferenceAtTheEnd(const std::vector<Odometry>& a, const std::vector<Odometry>& b);

}  // namespace cairn::slam
