// "Which way did the robot go?" The online poses exactly as they were published, one per scan used; or, `smoothed`, the
// path of the enabled map version's smoothing job (else the newest one's). FAILED_PRECONDITION where none has finished.
// Pure function of snapshots.
#pragma once

#include "common/service/request.h"
#include "server/maps/map_snapshot.h"
#include "server/robots/session_snapshot.h"

namespace cairn::server {

// `map` may be null: no smoothed path then.
[[nodiscard]] Reply AnswerPath(const Request& request, const SessionSnapshot& session, const MapSnapshot* map);

}  // namespace cairn::server
