// Writes the server's generation into a value that is about to be sent, and into everything nested in it. No other
// place does this. Stateless, thread-safe.
#pragma once

#include "common/service/generation.h"
#include "server/outbound.h"

namespace cairn::server {

void Stamp(OutboundValue& value, Generation generation);

}  // namespace cairn::server
