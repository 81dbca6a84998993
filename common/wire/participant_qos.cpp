#include "common/wire/participant_qos.h"

#include <fastdds/rtps/attributes/ServerAttributes.h>
#include <fastrtps/attributes/LibrarySettingsAttributes.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>

#include <algorithm>
#include <fastdds/dds/log/Log.hpp>
#include <mutex>
#include <random>

#include "common/wire/discovery_servers.h"
#include "common/wire/library_repairs.h"
#include "common/wire/security.h"

#ifdef CAIRN_ADDRESS_SANITIZER
// Fast DDS 2.9 deletes one of its own objects with the wrong size (RTPSWriter::~RTPSWriter). With this check,
// the address sanitizer would stop every program at the end of its first publication. All other checks stay
// on, and ASAN_OPTIONS can switch this one on again.
extern "C" const char* __asan_default_options() {  // NOLINT(readability-identifier-naming): the sanitizer's name.
  return "new_delete_type_mismatch=0";
}
#endif

namespace cairn::wire {
namespace {

namespace fd = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::Duration_t;

// Two programs that start together on a busy machine may miss each other's first announcements. With this
// period they find each other a few seconds later, even if the lease is long.
constexpr double kMaxAnnouncementPeriodS = 3.0;

// REQUIRES: Validate.
void UseServers(const std::vector<std::string>& servers, rtps::BuiltinAttributes& builtin) {
  builtin.discovery_config.discoveryProtocol = rtps::DiscoveryProtocol_t::CLIENT;
  for (std::size_t i = 0; i < servers.size(); ++i) {
    const auto server = ParseDiscoveryServer(servers[i]);
    rtps::RemoteServerAttributes remote;
    rtps::get_server_client_default_guidPrefix(static_cast<int>(i), remote.guidPrefix);
    rtps::Locator_t locator(LOCATOR_KIND_UDPv4, server->port);
    rtps::IPLocator::setIPv4(locator, server->address);
    remote.metatrafficUnicastLocatorList.push_back(locator);
    builtin.discovery_config.m_DiscoveryServers.push_back(remote);
  }
}

}  // namespace

// Fast DDS numbers the participants of a process one after the other, so their GUIDs differ in a few bits. A datagram
// that was damaged or forged, with another GUID in the place of one that is known, then often names a participant that
// does not exist yet. Its peers remember what the forgery said and ignore the real one when it joins. A client that
// joined anew because it was deaf stayed deaf for this reason, several times in a row (cairn-study hostile).
rtps::GuidPrefix_t UnpredictablePrefix() {
  rtps::GuidPrefix_t prefix;
  std::copy(rtps::c_VendorId_eProsima.begin(), rtps::c_VendorId_eProsima.end(), prefix.value);
  std::random_device device;
  std::generate(prefix.value + rtps::c_VendorId_eProsima.size(), prefix.value + rtps::GuidPrefix_t::size,
                [&device] { return static_cast<rtps::octet>(device()); });
  return prefix;
}

// A library must not print, and messages that peers can provoke must not fill a disk. Errors are returned as
// values.
void ConfigureLibraryOnce() {
  static std::once_flag once;
  std::call_once(once, [] {
    UseRepairs();
    fd::Log::ClearConsumers();
    fd::Log::SetVerbosity(fd::Log::Kind::Error);
    // Delivery within a process would lose samples for good when a reader is full (measured), so samples
    // always go through the socket.
    eprosima::fastrtps::LibrarySettingsAttributes settings;
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
  });
}

fd::DomainParticipantQos ParticipantQos(const WireOptions& options, const std::string& name,
                                        const std::shared_ptr<GuardReport>& report) {
  fd::DomainParticipantQos qos;
  qos.name(name);
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(MakeGuardedUdp(options.interfaces, report, !options.security.empty()));
  qos.wire_protocol().prefix = UnpredictablePrefix();
  auto& builtin = qos.wire_protocol().builtin;
  builtin.discovery_config.leaseDuration = Duration_t(options.participant_lease_s);
  builtin.discovery_config.leaseDuration_announcementperiod =
      Duration_t(std::min(options.participant_lease_s / 3.0, kMaxAnnouncementPeriodS));
  if (!options.discovery_servers.empty()) UseServers(options.discovery_servers, builtin);
  if (!options.security.empty()) AddSecurity(options.security, qos);
  builtin.readerHistoryMemoryPolicy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  builtin.writerHistoryMemoryPolicy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  return qos;
}

}  // namespace cairn::wire
