// UDPv4 with a guard: every datagram passes InspectDatagram before the participant sees it; what does not pass is
// dropped and counted. Fast DDS 2.x transport API, so this header stays inside common/wire.
#pragma once

#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace cairn::wire {

// Binds sockets to the given IPv4 addresses only. `refused` counts, and outlives the transport by shared ownership.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> MakeGuardedUdp(
    const std::vector<std::string>& interfaces, std::shared_ptr<std::atomic<std::uint64_t>> refused);

}  // namespace cairn::wire
