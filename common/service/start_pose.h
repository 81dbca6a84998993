// Where a robot stands in the map when its run begins: as peers send it and as people type it. Metres and radians.
#pragma once

#include <string>

#include "common/geometry/pose2.h"
#include "common/status.h"

namespace cairn {

// Finite, and within 1000 km of the map's origin along either axis.
[[nodiscard]] Result<void> ValidateStart(const Pose2& T_map_robot_start);

// "x,y,theta" in metres and radians, or degrees if the last part ends in "deg": "1.5,-2,90deg". Valid, theta
// wrapped; the error names the text.
[[nodiscard]] Result<Pose2> ParseStart(const std::string& text);

}  // namespace cairn
