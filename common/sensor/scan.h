// One sweep of a planar laser scanner, as a plain value. Frames: beams in `laser`, mounting T_robot_laser.
// Not validated by construction: everything that arrives from a peer or a file passes ValidateScan first, and only
// validated scans reach an estimator.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"
#include "common/status.h"

namespace cairn {

inline constexpr int kMaxBeams = 8192;

struct Scan {
  std::uint64_t sequence = 0;    // Per (robot, sensor), from 1, +1 per scan sent. 0: unnumbered.
  Stamp stamp = 0;               // Time of the first beam.
  double angle_first_rad = 0.0;  // Direction of ranges_m[0] in `laser`.
  double angle_step_rad = 0.0;   // Between beams; negative for a scanner that turns clockwise.
  double range_min_m = 0.0;      // Shorter ranges are not measurements.
  double range_max_m = 0.0;      // Ranges at or above it mean "nothing hit" up to there.
  double beam_period_s = 0.0;    // Between beams; 0 if the whole scan is taken at once. See OrderByTime.
  double tilt_rad = 0.0;         // Turn of the scan plane about the laser's y axis: positive looks down.
  Pose2 T_robot_laser;
  std::vector<float> ranges_m;  // NaN, negative, zero, infinite allowed: see BeamClass.
};

// The meaning of one range. Infinity, or a range from range_max on, is free space up to range_max. NaN, <= 0 or a range
// below range_min carries no information.
enum class BeamClass : std::uint8_t { kHit, kNoReturn, kInvalid };
[[nodiscard]] BeamClass ClassifyRange(float range_m, double range_min_m, double range_max_m);

// Why a scan is refused. The first fault found counts, in the order of the checks below.
enum class ScanFault : std::uint8_t {
  kEmpty,         // No beam, or none with a usable range.
  kTooManyBeams,  // More than kMaxBeams.
  kBadGeometry,   // Angles, range limits, tilt, mounting or times that describe no scanner.
};
struct ScanRefusal {
  ScanFault fault = ScanFault::kEmpty;
  std::string message;  // Names the value that is wrong.
};

// Checks what an estimator relies on: 1..kMaxBeams beams; finite angles with a step of at least 1e-5 rad to either
// side and a span of at most one turn; 0 <= range_min < range_max, finite; |tilt| < pi/2; mounting within 100 m; a
// finite non-negative beam period and at most 10 s from the first beam to the last; at least one beam that is not
// kInvalid. Single bad ranges are normal and stay (kInvalid).
[[nodiscard]] tl::expected<void, ScanRefusal> ValidateScan(const Scan& scan);

// Many drivers list the beams of a lidar in the other order than it measures them. They say so by a negative beam
// period: beam i was measured at stamp + i * beam_period_s, so the first one last. Lists such beams in the order of
// their times: every beam keeps its direction, range and time, and the period becomes positive. Other scans stay as
// they are, and so do those with times that ValidateScan refuses.
void OrderByTime(Scan& scan);

}  // namespace cairn
