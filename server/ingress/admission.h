// Decides whether a received sample is valid or refused, and why. The contents of scans and odometry are
// checked only here. Numbers begin at 1: the ledger can not say what has become of a sample with the number 0.
// Stateless, thread-safe.
#pragma once

#include <chrono>

#include "common/service/stream.h"
#include "server/inbound.h"

namespace cairn::server {

// A refused scan keeps only its sequence and its stamp.
[[nodiscard]] ScanArrival Admit(ScanSample&& sample, std::chrono::steady_clock::time_point received);
[[nodiscard]] OdometryArrival Admit(OdometrySample&& sample);

}  // namespace cairn::server
