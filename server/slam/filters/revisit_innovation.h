// A revisit against what a hypothesis expected of it: the robot's place relative to an old keyframe. Stateless.
#pragma once

#include "server/slam/filters/filter.h"
#include "server/slam/filters/innovation.h"

namespace cairn::slam {

// The old keyframe's pose counts as known; Jacobian by the robot's pose.
[[nodiscard]] Innovation<3> InnovateRevisit(const Pose2& T_map_keyframe, const Pose2& T_map_robot,
                                            const RevisitObservation& revisit);

}  // namespace cairn::slam
