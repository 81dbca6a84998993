// "Where is the robot, or where was it at a stamp?" A stamp between two poses is interpolated. UNAVAILABLE: not yet
// (nothing used so far, or the stamp lies after the newest pose of a running session); OUT_OF_RANGE: never (before the
// first pose, or after the last one of an ended session). Pure function of a snapshot.
#pragma once

#include "common/service/request.h"
#include "server/robots/session_snapshot.h"

namespace cairn::server {

[[nodiscard]] Reply AnswerPose(const Request& request, const SessionSnapshot& session);

}  // namespace cairn::server
