// All that a log shows of a robot's lidar and wheels that nobody has told: when the beams of a scan are measured
// (laser_turn.h), and how scans and odometry fit together (laser_mounting.h), each with its doubt. The two parts are
// estimated in turn until they agree. Stateless, deterministic; on any number of threads the same.
#pragma once

#include <cstdint>

#include "common/status.h"
#include "server/slam/calibration/laser_mounting.h"
#include "server/slam/calibration/laser_turn.h"

namespace cairn::slam {

struct LaserFitOptions {
  std::int64_t pairs_along = 400;    // Pairs of scans along the way; more give a smaller doubt and take longer.
  std::int64_t pairs_turning = 120;  // Pairs of scans of unequal turns, of which each is aligned some fifty times.
  double widest_lag_s = 1.0;
  std::uint64_t seed = 1;
};

struct LaserFit {
  double scan_period_s = 0.0;  // Median time between two scans.
  TurnFit turn;
  MountingFit mounting;
  // How LogReaderOptions::timing says it: the place of the stamp for which the lag is smallest.
  LidarTiming timing;
  double lag_s = 0.0;  // For that place.
};

// kFailedPrecondition: fewer than ten pairs of scans can be compared.
[[nodiscard]] Result<LaserFit> FitLaser(const LaserLog& log, const LaserFitOptions& options,
                                        const ParallelFor& parallel_for);

}  // namespace cairn::slam
