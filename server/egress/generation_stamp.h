// Writes the server's generation into a value on its way out, and into everything nested in it: the only place that
// does. Stateless, thread-safe.
#pragma once

#include "common/service/generation.h"
#include "server/outbound.h"

namespace cairn::server {

void Stamp(OutboundValue& value, Generation generation);

}  // namespace cairn::server
