// Simulated runs round the UMBmark square, with which the calibration is tested. The robot has known wheel
// errors and drives what its odometry takes for the exact square, with random slip and, if wanted, bumps
// under its inner wheel.
// Frame: `start`, the first leg along x. The same engine state gives the same run. Stateless.
// Source: Borenstein, Feng 1996 (ten bumps along the path, under the wheel inside the square).
#pragma once

#include <random>

#include "server/slam/calibration/umbmark.h"

namespace cairn::slam {

struct SquareRunOptions {
  WheelErrors errors;
  double slip_m_per_sqrt_m = 0.002;
  std::int64_t bumps = 0;
  double bump_m = 0.004;
};
void Visit(OptionVisitor& visitor, SquareRunOptions& options);

[[nodiscard]] SquareRun SimulateSquareRun(bool clockwise, const SquareRunOptions& run, const UmbmarkOptions& square,
                                          std::mt19937_64& engine);

}  // namespace cairn::slam
