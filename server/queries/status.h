// "Who is here, and what became of their scans?" Session states, newest poses and ledgers. Pure function of snapshots.
#pragma once

#include <vector>

#include "common/service/request.h"
#include "server/robots/session_snapshot.h"

namespace cairn::server {

// Of one site where the request names one.
[[nodiscard]] Reply AnswerStatus(const Request& request, const std::vector<SessionSnapshot>& sessions);

}  // namespace cairn::server
