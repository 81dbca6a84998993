// Decides when a scan is worth an update of filter and map: when the robot has moved or turned enough since the last.
// Source: the linearUpdate / angularUpdate rule of GMapping (Grisetti 2007).
#pragma once

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct MotionGateOptions {
  double distance_m = 0.25;  // Larger: fewer keyframes, less time and memory, coarser map.
  double turn_rad = 0.2;
};
void Visit(OptionVisitor& visitor, MotionGateOptions& options);

[[nodiscard]] bool MovedEnough(const Pose2& T_last_now, const MotionGateOptions& options);

}  // namespace cairn::slam
