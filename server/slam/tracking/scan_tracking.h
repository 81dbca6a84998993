// Looks at a scan and follows the robot to it. Where the beams of the scan were measured one after the other, the
// match corrects the motion that was assumed within the scan: without odometry, the scan is seen as from a robot that
// goes on as in its last step; and where the match shows another motion than the one that was taken out of the scan,
// the scan is computed anew with the motion that was matched, and aligned once more. The better of both answers counts.
// A scan that was taken at once is followed directly. Stateless, thread-safe.
#pragma once

#include <memory>
#include <optional>

#include "server/slam/features/scan_view.h"
#include "server/slam/scan/scan_motion.h"
#include "server/slam/tracking/front_end.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

struct TrackScanOptions {
  const FrontEndOptions& front_end;
  const RollingOptions& rolling;
};

struct TrackedScan {
  std::shared_ptr<const Scan> scan;  // All beams at its stamp.
  ScanView view;
  TrackStep step;
};

// The scan before another one.
struct ScanBefore {
  Stamp stamp = 0;
  Pose2 T_track_robot;
};

// `scan`: all beams at its stamp, by odometry. `rolling` is the same scan as it was measured; null if it was
// taken at once. `trail` has the scans before this one, but for `last`, if that is given.
[[nodiscard]] TrackedScan TrackScan(FrontEnd& front_end, const TrackScanOptions& options, const Trail& trail,
                                    std::shared_ptr<const Scan> scan, const RollingScan* rolling,
                                    const Pose2& T_odom_robot, const ParallelFor& parallel_for,
                                    std::optional<ScanBefore> last = std::nullopt);

}  // namespace cairn::slam
