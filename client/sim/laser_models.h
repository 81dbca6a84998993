// The scanners of the thesis by name: field of view, resolution, range and error. Mounting, dropouts and sweep are
// those of LaserOptions' defaults. Source: thesis C 4.3.2 (the simulator's own: +-90 deg in steps of 1 deg), 4.3.3
// (errors); makers' data sheets for field of view, resolution and range: SICK LMS200/291, Hokuyo URG-04LX and
// URG-04LX-UG01.
#pragma once

#include <string>
#include <vector>

#include "client/sim/laser.h"
#include "common/status.h"

namespace cairn::sim {

[[nodiscard]] std::vector<std::string> LaserModelNames();

// `laser` with the model's field of view, resolution, range and error.
[[nodiscard]] Result<LaserOptions> WithModel(const LaserOptions& laser, const std::string& name);

}  // namespace cairn::sim
