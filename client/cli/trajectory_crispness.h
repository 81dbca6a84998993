// How crisp the map is that a trajectory makes of the scans of a log (common/cloud/map_entropy.h). It needs no truth,
// and compares trajectories of one log. No server.
#pragma once

#include <cstddef>
#include <string>

#include "common/cloud/map_entropy.h"
#include "common/sensor/log_reader.h"
#include "common/sensor/trajectory.h"
#include "common/status.h"

namespace cairn::client {

struct CrispnessOptions {
  MapEntropyOptions entropy;
  // One point is kept per square of this size: what was seen a thousand times from a standstill is one place.
  double spacing_m = 0.005;
  double max_range_m = 1e4;  // Hits that are farther away are left out.
};

struct TrajectoryCrispness {
  MapCrispness map;
  std::size_t points = 0;
  std::size_t scans = 0;
  std::size_t scans_left_out = 0;  // Without a pose on the trajectory, tilted, or not valid.
};

struct NamedCrispness {
  std::string name;  // The trajectory's.
  TrajectoryCrispness crispness;
};

// The odometry in the log. kFailedPrecondition: it has none.
[[nodiscard]] Result<Trajectory> ReadOdometry(const std::string& log, const LogReaderOptions& reader);

// Each beam is placed at the trajectory's pose at the time when it was measured, between two poses at most 0.5 s apart;
// beams without such poses are left out. kResourceExhausted: more than 10 million points (some 0.6 GB). kCancelled: the
// user asked to stop.
[[nodiscard]] Result<TrajectoryCrispness> MeasureCrispness(const std::string& log, const LogReaderOptions& reader,
                                                           const Trajectory& trajectory,
                                                           const CrispnessOptions& options);

}  // namespace cairn::client
