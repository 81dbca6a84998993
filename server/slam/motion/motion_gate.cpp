#include "server/slam/motion/motion_gate.h"

#include <cmath>

namespace cairn::slam {

void Visit(OptionVisitor& visitor, MotionGateOptions& options) {
  visitor.Real("distance_m", options.distance_m, "m", 0.0, 10.0,
               ForOperators("A scan becomes a keyframe when the robot has moved this far since the last one. Larger "
                            "values take less time and memory, and the map becomes coarser."));
  visitor.Real("turn_rad", options.turn_rad, "rad", 0.0, 3.2,
               ForOperators("A scan also becomes a keyframe when the robot has turned by this since the last one."));
}

bool MovedEnough(const Pose2& T_last_now, const MotionGateOptions& options) {
  return T_last_now.translation().norm() >= options.distance_m || std::abs(T_last_now.theta) >= options.turn_rad;
}

}  // namespace cairn::slam
