// Simulated runs round the UMBmark square: a robot with known wheel errors that believes it drives the square exactly,
// with random slip, and bumps under its inner wheel if asked. What the calibration is proved on.
// Frame: `start`, the first leg along x. Same engine state, same run. Stateless.
// Source: Borenstein, Feng 1996 (ten bumps along the path, under the wheel inside the square).
#pragma once

#include <random>

#include "server/slam/motion/umbmark.h"

namespace cairn::slam {

struct SquareRunOptions {
  WheelErrors errors;                // Injected.
  double slip_m_per_sqrt_m = 0.002;  // Standard deviation of one wheel's way after 1 m.
  std::int64_t bumps = 0;            // Along the four sides, evenly; under the inner wheel.
  double bump_m = 0.004;             // What a bump takes of a wheel's way.
};
void Visit(OptionVisitor& visitor, SquareRunOptions& options);

[[nodiscard]] SquareRun SimulateSquareRun(bool clockwise, const SquareRunOptions& run, const UmbmarkOptions& square,
                                          std::mt19937_64& engine);

}  // namespace cairn::slam
