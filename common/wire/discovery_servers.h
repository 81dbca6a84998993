// How participants find each other where multicast does not reach: through servers of Fast DDS (fast-discovery-server),
// which tell each participant of those whose topics it shares. This header may be included only inside common/wire.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/status.h"

namespace cairn::wire {

struct DiscoveryServer {
  std::string address;  // IPv4.
  std::uint16_t port = 0;
};

// Reads "ADDRESS" (the port is 11811 then) or "ADDRESS:PORT". kInvalidArgument: it is neither.
[[nodiscard]] Result<DiscoveryServer> ParseDiscoveryServer(const std::string& text);

}  // namespace cairn::wire
