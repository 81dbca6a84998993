// What a participant with DDS Security knows of its peers: which of them were refused and why, and which robot each
// remote writer may speak for. Without security it does nothing.
// The robot: a writer of a robot's streams is in one DDS partition, which is named as the robot. The access control of
// Fast DDS 2.9 has compared it with the permissions that the fleet's CA has signed before it matches the writer. The
// GUID would be no proof: the library does not compare it with the certificate. Fast DDS compares the partition once. A
// writer that announces another one later, also after it was removed, is therefore refused until its participant
// is gone: its samples are rejected.
// The reasons: the callbacks of Fast DDS give no reason and do not report a refused endpoint, so both come from its
// log. Thread-safe. This header uses the Fast DDS 2.x API; include it only inside common/wire.
#pragma once

#include <chrono>
#include <cstdint>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "common/service/refusals.h"
#include "common/service/stream.h"

namespace cairn::wire {

class PeerWatch final : public eprosima::fastdds::dds::DomainParticipantListener {
 public:
  using Clock = std::chrono::steady_clock;
  using Guid = eprosima::fastrtps::rtps::GUID_t;
  // How long a peer may take to prove its identity before it counts as refused. It can still succeed.
  static constexpr std::chrono::seconds kPatience{10};
  static constexpr double kMaxLines = 32.0;       // At once,
  static constexpr double kLinesPerSecond = 0.1;  // and in the long run.

  [[nodiscard]] static std::shared_ptr<PeerWatch> Make(bool secure);
  explicit PeerWatch(bool secure) : secure_(secure) {}

  // Whether samples of this writer may be about this robot. If not, it is counted and logged. Without security: always.
  [[nodiscard]] bool MaySpeakFor(const Guid& writer, NameId robot);
  // Since the start.
  [[nodiscard]] Refusals refusals(Clock::time_point now = Clock::now());
  // One line for each peer or endpoint refused since the last call, for the log of the program. If many are refused,
  // only some are named: strangers must not fill a disk.
  [[nodiscard]] std::vector<std::string> TakeLines();

  // Called with the library's log lines of the category SECURITY.
  void OnLibraryError(const std::string& message);

 private:
  using Participant = eprosima::fastdds::dds::DomainParticipant;
  struct Peer {
    std::string address;
    Clock::time_point since{};
    bool authorized = false;
    bool refused = false;
  };

  void on_participant_discovery(Participant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void onParticipantAuthentication(Participant* participant,
                                   eprosima::fastrtps::rtps::ParticipantAuthenticationInfo&& info) override;
  void on_publisher_discovery(Participant* participant, eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
  void MakeRoom() CAIRN_REQUIRES(mutex_);
  void Forget(const Guid& participant) CAIRN_REQUIRES(mutex_);
  void Refuse(const Guid& guid, const std::string& reason) CAIRN_REQUIRES(mutex_);
  // Names an endpoint once.
  void SayOf(const Guid& endpoint, const std::string& line) CAIRN_REQUIRES(mutex_);
  void Say(const std::string& line) CAIRN_REQUIRES(mutex_);

  const bool secure_;
  Mutex mutex_;
  Refusals refusals_ CAIRN_GUARDED_BY(mutex_);
  std::map<Guid, Peer> peers_ CAIRN_GUARDED_BY(mutex_);
  std::map<Guid, std::string> robots_ CAIRN_GUARDED_BY(mutex_);  // Robot by writer; empty if none is allowed.
  std::set<Guid> named_ CAIRN_GUARDED_BY(mutex_);                // Endpoints that a line has named.
  std::vector<std::string> lines_ CAIRN_GUARDED_BY(mutex_);
  double lines_allowed_ CAIRN_GUARDED_BY(mutex_) = kMaxLines;
  Clock::time_point allowed_at_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::wire
