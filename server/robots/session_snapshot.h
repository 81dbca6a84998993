// What the world may know of a session at one moment: plain values, copied under the session's lock and never changed
// after. Queries answer from this, so that they never lock an estimator.
#pragma once

#include <memory>
#include <vector>

#include "common/service/request.h"
#include "server/robots/pose_history.h"
#include "server/robots/robot_event.h"

namespace cairn::server {

struct SessionSnapshot {
  SessionId id = 0;
  RobotStatus status;
  PathView path;  // Online poses, one per scan used, as published.
  std::shared_ptr<const std::vector<LandmarkReport>> landmarks;
  std::vector<PoseHypothesis> hypotheses;  // The most believed first; of half a second of scans ago at most.
};

}  // namespace cairn::server
