// Picks the question's file and the snapshots it needs. Answers questions only: what changes something (submit, cancel,
// end, enable) is the server's desk. The reply may be large: SplitReply cuts it for the wire.
// Thread rule: any thread.
#pragma once

#include "common/service/request.h"
#include "server/queries/views.h"

namespace cairn::server {

[[nodiscard]] Reply Answer(const Request& request, const Views& views);

// An answer without content; the beginning of every other.
[[nodiscard]] Reply ReplyTo(const Request& request, Status status = {});

}  // namespace cairn::server
