// Takes the motion of the robot during a scan out of the scan. A lidar that turns measures its beams one after the
// other (Scan::beam_period_s), and the robot drives on meanwhile: at 1 rad/s and 0.2 s a turn, the last beam is 11 deg
// away from where the scan says that it is.
//
// The result is the scan that a lidar would have taken with all beams at once, at the stamp of the scan. Each end of a
// beam is moved by the odometry between the stamp and the time of the beam, as seen from the lidar at the stamp. The
// ends are then no longer at the angles of the beams; therefore each beam of the result gets the range at which it cuts
// the line between two neighbouring ends on one surface, and otherwise that of the nearest end. Where
// the turn of the robot shows a place twice, a surface counts more than a single end, an end more than a beam that hit
// nothing, and among equals the first one counts. A beam without any evidence is
// invalid (not a number). The scan plane is taken to be level. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <span>

#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"

namespace cairn::slam {

struct DeskewOptions {
  double surface_gap_m = 0.05;
  double surface_steps = 6.0;
};

// The time from the stamp to the last beam.
[[nodiscard]] std::uint64_t DurationNs(const Scan& scan);

// `odometry`: in the order of the stamps, from the last sample at or before the stamp on. After its last sample the
// robot is taken to stand. The result has a beam_period_s of 0; if all samples have the same pose, only this has
// changed. The result may have no usable beam left. REQUIRES: the scan passed ValidateScan; `odometry` is not empty and
// its first sample is not after the scan's stamp.
[[nodiscard]] Scan Deskew(const Scan& scan, std::span<const Odometry> odometry, const DeskewOptions& options = {});

}  // namespace cairn::slam
