// How scans and odometry of one log fit together: the lag between their clocks, the errors of the wheels, and where the
// lidar is mounted. Alignments of pairs of scans are compared with what odometry says of the same times:
//   T_first_second(laser) = T_robot_laser^-1 * odometry(first -> second; wheels, lag) * T_robot_laser
// for all pairs at once, by robust least squares. The doubt is the larger one of two: from the curvature, and
// from drawing stretches of the log anew. Stateless, deterministic.
// Source: Censi, Franchi, Marchionni, Oriolo 2013, "Simultaneous calibration of odometry and sensor parameters for
// mobile robots" (the constraint and what it shows); the lag in addition; resampling of blocks: Kuensch 1989.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "server/slam/calibration/laser_pairs.h"

namespace cairn::slam {

// What is estimated, in this order.
enum class LaserUnknown : std::uint8_t { kLag, kWheelScale, kTurnScale, kTurnPerM, kX, kY, kHeading };
inline constexpr std::size_t kLaserUnknowns = 7;

struct MountingFit {
  double lag_s = 0.0;
  WheelCorrection wheels;
  Pose2 T_robot_laser;
  std::array<double, kLaserUnknowns>
      doubt{};  // Standard deviations, in the units of the values (s, 1, 1, rad/m, m, m, rad).
  // Whether the log shows it. What it does not show keeps the value of the guess.
  std::array<bool, kLaserUnknowns> shown{};
  int pairs = 0;  // Aligned.

  [[nodiscard]] bool Shows(LaserUnknown what) const { return shown[static_cast<std::size_t>(what)]; }
  [[nodiscard]] double Doubt(LaserUnknown what) const { return doubt[static_cast<std::size_t>(what)]; }
};

// `pairs` were aligned under `guess`. `odometry`: as logged. The lag is searched within `widest_lag_s` of the guess.
[[nodiscard]] MountingFit FitMounting(std::span<const Odometry> odometry, std::span<const AlignedPair> pairs,
                                      const LaserGuess& guess, double widest_lag_s, std::uint64_t seed);

}  // namespace cairn::slam
