// The lines of the log about requests. Each has the request's id (RequestId), which the client names in its error.
// While memory is short, lines may be lost. Thread rule: any thread.
#pragma once

#include "common/log_line.h"
#include "common/service/request.h"

namespace cairn::server {

// For a LogContext of a thread that works on the request.
[[nodiscard]] LogSubject FieldsOf(const Request& request);

// What was asked, of which client, the result, and the time since the server took the request. Commands are logged at
// level info, because they change something. Questions are logged at level debug, because a client may send very many.
void LogAnswered(const Request& request, const Status& status);
// The same for a request that found no room. A client may send more of them than the desk could ever answer, so
// commands are at level debug too.
void LogRefused(const Request& request, const Status& status);

}  // namespace cairn::server
