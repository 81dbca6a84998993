// How the robot moved while a scan was taken, as samples of odometry from which Deskew (deskew.h) takes the motion out
// of the scan. Usually they are odometry itself; the functions here make them where odometry is not used, or
// where the match of the scan has shown that odometry is wrong. Poses are in any fixed frame. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"
#include "server/slam/scan/deskew.h"

namespace cairn::slam {

// How the motion is found in scans whose beams were measured one after the other.
struct RollingOptions {
  DeskewOptions deskew;
  double worthwhile_m = 0.01;
  double worthwhile_rad = 0.01;
  // No keys of the configuration:
  double longest_s = 1.0;  // A speed that is older than this is not used.
  // The step to a scan with the wrong motion in it is itself wrong by up to half of the error of that motion, so that
  // the first look halves the error only.
  std::int64_t most_looks = 4;
};
void Visit(OptionVisitor& visitor, RollingOptions& options);

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
