// The QoS of every participant of this project: the guarded UDP transport on the named interfaces and nothing else, the
// leases, and DDS Security where it is on. This header uses the Fast DDS 2.x API; include it only inside common/wire.
#pragma once

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <memory>
#include <string>

#include "common/wire/bus.h"
#include "common/wire/guard_transport.h"

namespace cairn::wire {

// Settings of the library that hold for the whole process. To be called before a participant is made.
void ConfigureLibraryOnce();

// The first part of a GUID, random behind the vendor's two bytes.
[[nodiscard]] eprosima::fastrtps::rtps::GuidPrefix_t UnpredictablePrefix();

[[nodiscard]] eprosima::fastdds::dds::DomainParticipantQos ParticipantQos(const WireOptions& options,
                                                                          const std::string& name,
                                                                          const std::shared_ptr<GuardReport>& report);

}  // namespace cairn::wire
