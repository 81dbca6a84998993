#include "server/slam/motion/motion_gate.h"

#include <cmath>

namespace cairn::slam {

void Visit(OptionVisitor& visitor, MotionGateOptions& options) {
  visitor.Real("distance_m", options.distance_m, "m", 0.0, 10.0,
               "Moved since the last keyframe; larger: fewer keyframes, less time and memory, coarser map.");
  visitor.Real("turn_rad", options.turn_rad, "rad", 0.0, 3.2, "Turned since the last keyframe.");
}

bool MovedEnough(const Pose2& T_last_now, const MotionGateOptions& options) {
  return T_last_now.translation().norm() >= options.distance_m || std::abs(T_last_now.theta) >= options.turn_rad;
}

}  // namespace cairn::slam
