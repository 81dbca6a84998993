// A mount that nods the scanner now and then: after a number of level scans, one sweep of tilted ones, each taken at
// one tilt. The robot halts for it, unless told to drive on. Tilts are about the laser's y axis, positive downwards.
// Source: thesis C 4.3.2 (rotation about the lateral axis), 6 ("the robot stops and the platform rotates").
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/status.h"

namespace cairn::sim {

struct TiltOptions {
  int scans = 0;                      // Scans of one nod; 0: the mount is fixed and level.
  double first_rad = Radians(-60.0);  // Tilt of the first scan of a nod (upwards).
  double last_rad = Radians(45.0);    // Tilt of the last scan of a nod (downwards).
  int level_scans = 60;               // Level scans between two nods.
  bool halt = true;                   // The robot stands while the mount moves.
};
// `halt_scans`: how many scans the robot needs to stop.
[[nodiscard]] Result<void> Validate(const TiltOptions& options, int halt_scans);

// The tilt of the scan with this number, counted from 0.
[[nodiscard]] double TiltOf(std::uint64_t scan, const TiltOptions& options);
// Whether the robot must brake or stand when this scan is taken.
[[nodiscard]] bool HaltsAt(std::uint64_t scan, const TiltOptions& options, int halt_scans);

}  // namespace cairn::sim
