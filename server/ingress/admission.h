// What a door decides about a sample before it becomes an event: valid or refused, and why. The only place where
// contents of the wire are checked. Stateless, thread-safe.
#pragma once

#include <chrono>

#include "common/service/stream.h"
#include "server/inbound.h"

namespace cairn::server {

// A refused scan keeps its sequence and stamp only.
[[nodiscard]] ScanArrival Admit(ScanSample&& sample, std::chrono::steady_clock::time_point received);
[[nodiscard]] OdometryArrival Admit(OdometrySample&& sample);

}  // namespace cairn::server
