#include "common/sensor/scan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

namespace cairn {
namespace {

constexpr double kMaxMountingDistance = 100.0;  // m
constexpr double kMinStep = 1e-5;               // rad. The finest planar scanners have steps of some 1e-4 rad.
constexpr double kMaxDuration = 10.0;           // From the first beam to the last, in s.
// A full turn computed as step * (beams - 1) in floating point may exceed 2 pi by rounding alone.
constexpr double kSpanSlack = 1e-6;

using Validity = tl::expected<void, ScanRefusal>;

tl::unexpected<ScanRefusal> Refuse(ScanFault fault, std::string message) {
  return tl::unexpected(ScanRefusal{fault, std::move(message)});
}

tl::unexpected<ScanRefusal> Bad(const std::string& what, double value) {
  return Refuse(ScanFault::kBadGeometry, what + " (" + std::to_string(value) + ")");
}

Validity ValidateGeometry(const Scan& scan) {
  if (!std::isfinite(scan.angle_first_rad)) return Bad("angle of the first beam is not finite", scan.angle_first_rad);
  if (std::abs(scan.angle_first_rad) > 4.0 * kPi) return Bad("angle of the first beam", scan.angle_first_rad);
  if (!std::isfinite(scan.angle_step_rad) || std::abs(scan.angle_step_rad) < kMinStep) {
    return Bad("angle step must be finite and at least 0.00001 rad to either side", scan.angle_step_rad);
  }
  const double span = std::abs(scan.angle_step_rad) * static_cast<double>(scan.ranges_m.size() - 1);
  if (!(span <= 2.0 * kPi + kSpanSlack)) return Bad("field of view exceeds one turn", span);
  if (!std::isfinite(scan.range_min_m) || scan.range_min_m < 0.0) return Bad("range_min", scan.range_min_m);
  if (!std::isfinite(scan.range_max_m)) return Bad("range_max is not finite", scan.range_max_m);
  if (scan.range_max_m <= scan.range_min_m) return Bad("range_max is not above range_min", scan.range_max_m);
  if (!std::isfinite(scan.tilt_rad) || std::abs(scan.tilt_rad) >= kPi / 2) return Bad("tilt", scan.tilt_rad);
  if (!scan.T_robot_laser.IsFinite()) return Refuse(ScanFault::kBadGeometry, "mounting is not finite");
  const double distance = scan.T_robot_laser.translation().norm();
  if (!(distance <= kMaxMountingDistance)) return Bad("mounting is too far from the robot, in m", distance);
  const double period = scan.beam_period_s;
  const double duration = period * static_cast<double>(scan.ranges_m.size() - 1);
  if (!std::isfinite(period) || period < 0.0 || duration > kMaxDuration) return Bad("beam period", period);
  return {};
}

}  // namespace

BeamClass ClassifyRange(float range_m, double range_min_m, double range_max_m) {
  const double range = range_m;
  if (!(range > 0.0) || range < range_min_m) return BeamClass::kInvalid;
  return range >= range_max_m ? BeamClass::kNoReturn : BeamClass::kHit;
}

Validity ValidateScan(const Scan& scan) {
  if (scan.ranges_m.empty()) return Refuse(ScanFault::kEmpty, "no beams");
  if (scan.ranges_m.size() > kMaxBeams) {
    return Refuse(ScanFault::kTooManyBeams,
                  std::to_string(scan.ranges_m.size()) + " beams, at most " + std::to_string(kMaxBeams));
  }
  if (auto geometry = ValidateGeometry(scan); !geometry) return geometry;
  for (const float range : scan.ranges_m) {
    if (ClassifyRange(range, scan.range_min_m, scan.range_max_m) != BeamClass::kInvalid) return {};
  }
  return Refuse(ScanFault::kEmpty, "no beam has a usable range");
}

void OrderByTime(Scan& scan) {
  if (!(scan.beam_period_s < 0.0) || scan.ranges_m.empty()) return;
  const double gaps = static_cast<double>(scan.ranges_m.size() - 1), duration_s = -scan.beam_period_s * gaps;
  if (!(duration_s <= kMaxDuration)) return;
  const Stamp duration = StampFromSeconds(duration_s);
  if (scan.stamp < std::numeric_limits<Stamp>::min() + duration) return;
  scan.stamp -= duration;
  scan.angle_first_rad += gaps * scan.angle_step_rad;
  scan.angle_step_rad = -scan.angle_step_rad;
  scan.beam_period_s = -scan.beam_period_s;
  std::ranges::reverse(scan.ranges_m);
}

}  // namespace cairn
