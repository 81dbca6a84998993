// Decides whether a scan becomes a keyframe, which updates filter and map: it does if the robot has moved or
// turned enough since the last keyframe.
// Source: the linearUpdate / angularUpdate rule of GMapping (Grisetti 2007).
#pragma once

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct MotionGateOptions {
  double distance_m = 0.25;
  double turn_rad = 0.2;
};
void Visit(OptionVisitor& visitor, MotionGateOptions& options);

[[nodiscard]] bool MovedEnough(const Pose2& T_last_now, const MotionGateOptions& options);

}  // namespace cairn::slam
