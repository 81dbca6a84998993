#include "client/sim/tilt_mount.h"

#include <cmath>
#include <string>

namespace cairn::sim {
namespace {

// Place of a scan in the cycle of level scans and a nod.
std::uint64_t PhaseOf(std::uint64_t scan, const TiltOptions& options) {
  return scan % static_cast<std::uint64_t>(options.level_scans + options.scans);
}

}  // namespace

Result<void> Validate(const TiltOptions& o, int halt_scans) {
  if (o.scans < 0 || o.scans > 10'000) return Fail(StatusCode::kInvalidArgument, "tilt: a nod has 0..10000 scans");
  for (const double tilt : {o.first_rad, o.last_rad}) {
    if (!(std::abs(tilt) < kPi / 2)) return Fail(StatusCode::kInvalidArgument, "tilt: must stay within +-90 deg");
  }
  // A pause shorter than the braking would keep the robot braking for ever.
  const int least = o.halt ? 2 * halt_scans : 1;
  if (o.scans > 0 && (o.level_scans < least || o.level_scans > 1'000'000)) {
    return Fail(StatusCode::kInvalidArgument, "tilt: level scans between nods must be " + std::to_string(least) +
                                                  "..1000000, so that the robot gets somewhere");
  }
  return {};
}

double TiltOf(std::uint64_t scan, const TiltOptions& options) {
  if (options.scans == 0) return 0.0;
  const std::uint64_t phase = PhaseOf(scan, options), level = static_cast<std::uint64_t>(options.level_scans);
  if (phase < level) return 0.0;
  if (options.scans == 1) return options.first_rad;
  const double share = static_cast<double>(phase - level) / (options.scans - 1);
  return options.first_rad + share * (options.last_rad - options.first_rad);
}

bool HaltsAt(std::uint64_t scan, const TiltOptions& options, int halt_scans) {
  if (options.scans == 0 || !options.halt) return false;
  return PhaseOf(scan, options) + static_cast<std::uint64_t>(halt_scans) >=
         static_cast<std::uint64_t>(options.level_scans);
}

}  // namespace cairn::sim
