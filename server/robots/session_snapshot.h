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
  PathView path;  // One pose per scan that was used, where it lies in the present map (pose_history.h).
  std::shared_ptr<const std::vector<LandmarkReport>> landmarks;
  // The most believed first; of half a second of scans ago at most. Of a robot that is not localized: of a job, or of
  // its own searches.
  std::vector<PoseHypothesis> hypotheses;
};

}  // namespace cairn::server
