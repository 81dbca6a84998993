// A UDPv4 transport that checks every datagram with InspectDatagram before the participant sees it. Datagrams
// that fail the check are dropped and counted. Samples in fragments reach the participant as whole ones. This header
// uses the Fast DDS 2.x transport API; include it only inside common/wire.
#pragma once

#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/wire/receive_watch.h"
#include "common/wire/rtps_datagram.h"

namespace cairn::wire {

// The number of datagrams that were dropped, by fault.
using RefusedDatagrams = std::array<std::atomic<std::uint64_t>, kDatagramFaults>;

// What a transport tells of itself.
struct GuardReport {
  RefusedDatagrams refused{};
  std::atomic<std::uint64_t> bytes = 0;  // Of all datagrams that arrived.
  ReceiveWatch receiving;
};

// Binds sockets to the given IPv4 addresses only. `report` is shared because it must outlive the transport. `secure`:
// the participant uses DDS Security.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> MakeGuardedUdp(
    const std::vector<std::string>& interfaces, std::shared_ptr<GuardReport> report, bool secure);

}  // namespace cairn::wire
