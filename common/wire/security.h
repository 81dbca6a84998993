// DDS Security of a participant: who it is, and what the permissions signed by the fleet's CA allow it.
// deploy/security/make-fleet.sh makes the files. This header uses the Fast DDS 2.x API; include it only inside
// common/wire. Stateless, thread-safe.
// Source: OMG DDS-SECURITY 1.1: PKI-DH (8.7), Access-Permissions (9.4), AES-GCM-GMAC (9.5).
#pragma once

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <string>

#include "common/status.h"

namespace cairn::wire {

// Whether a participant can be made with the files of `directory`: identity_ca.pem, cert.pem, key.pem,
// governance.smime, permissions.smime. Fast DDS reports every fault of them by the same message without a reason, so
// they are checked first. An error names the file and the fault, and quotes nothing of the key. kFailedPrecondition:
// a file is missing or invalid, the certificate has expired, or they do not belong together. The dates of the
// permissions are not read.
[[nodiscard]] Result<void> CheckSecurityFiles(const std::string& directory);

// Makes the participant authenticate itself with these files, and demand the same of its peers.
void AddSecurity(const std::string& directory, eprosima::fastdds::dds::DomainParticipantQos& qos);

}  // namespace cairn::wire
