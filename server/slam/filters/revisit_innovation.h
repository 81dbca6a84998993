// The innovation of a revisit: the measured pose of the robot relative to an old keyframe, against the pose
// that a hypothesis expects. Stateless.
#pragma once

#include "server/slam/filters/filter.h"
#include "server/slam/landmarks/innovation.h"

namespace cairn::slam {

// The pose of the old keyframe counts as known. The Jacobian is with respect to the robot's pose.
[[nodiscard]] Innovation<3> InnovateRevisit(const Pose2& T_map_keyframe, const Pose2& T_map_robot,
                                            const RevisitObservation& revisit);

}  // namespace cairn::slam
