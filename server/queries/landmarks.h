// "Which landmarks does a site have in an area?" Those of every session's best particle, as of its last refresh.
// Pure function of snapshots.
#pragma once

#include <vector>

#include "common/service/request.h"
#include "server/robots/session_snapshot.h"

namespace cairn::server {

[[nodiscard]] Reply AnswerLandmarks(const Request& request, const std::vector<SessionSnapshot>& sessions);

}  // namespace cairn::server
