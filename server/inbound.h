// What the doors hand to the rooms: plain values over one bounded channel. The only way in.
// Overflow rule of the channel: a DDS callback never waits. What does not fit is left out and counted by the door:
// scans show as a gap in their numbers (lost_on_wire in the ledger), requests are answered "busy" at once, session
// requests are repeated by their clients.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <variant>

#include "common/bounded_channel.h"
#include "common/service/ledger.h"
#include "common/service/request.h"
#include "common/service/session.h"
#include "common/service/stream.h"

namespace cairn::server {

// A scan at the door. Refused ones carry sequence and stamp only: they are counted, never estimated.
struct ScanArrival {
  StreamId stream;
  std::shared_ptr<const Scan> scan;
  std::optional<DropReason> refused;
  std::chrono::steady_clock::time_point received;
};

struct OdometryArrival {
  StreamId stream;
  Odometry odometry;
  bool refused = false;
};

// A client process gained or lost its liveliness lease.
struct ClientLiveliness {
  ClientId client = 0;
  bool alive = false;
};

using InboundValue = std::variant<SessionRequest, ClientLiveliness, ScanArrival, OdometryArrival, Request>;
using Inbound = BoundedChannel<InboundValue>;

}  // namespace cairn::server
