#include "common/wire/peer_watch.h"

#include <fastdds/rtps/participant/ParticipantDiscoveryInfo.h>
#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>
#include <fastrtps/utils/IPLocator.h>

#include <algorithm>
#include <fastdds/dds/log/Log.hpp>
#include <mutex>
#include <regex>
#include <sstream>
#include <utility>

namespace cairn::wire {
namespace {

namespace fd = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

// More than a fleet has. What a peer can make grow stays below it.
constexpr std::size_t kMaxPeers = 4096;
constexpr std::size_t kMaxText = 512;
constexpr std::size_t kMaxWriters = 65536;

// The log of the library is one for the whole process, and so is this.
struct LibraryLog {
  Mutex mutex;
  std::vector<std::weak_ptr<PeerWatch>> watches CAIRN_GUARDED_BY(mutex);
  std::string certificate_fault CAIRN_GUARDED_BY(mutex);
};

LibraryLog& Library() {
  static LibraryLog log;
  return log;
}

class LogReader final : public fd::LogConsumer {
 public:
  void Consume(const fd::Log::Entry& entry) override {
    std::vector<std::shared_ptr<PeerWatch>> watches;
    {
      LibraryLog& log = Library();
      const MutexLock lock(log.mutex);
      if (entry.kind == fd::Log::Kind::Warning) {
        const auto open = entry.message.find('(');
        const auto close = entry.message.rfind(')');
        if (entry.message.rfind("Invalidation error of certificate", 0) == 0 && open < close)
          log.certificate_fault = entry.message.substr(open + 1, close - open - 1);
        return;
      }
      for (const auto& watch : log.watches)
        if (auto alive = watch.lock()) watches.push_back(std::move(alive));
    }
    for (const auto& watch : watches) watch->OnLibraryError(entry.message);
  }
};

// Makes the library's log readable for us. Only the category SECURITY: other messages may come without end.
void ReadLibraryLogOnce() {
  static std::once_flag once;
  std::call_once(once, [] {
    fd::Log::SetCategoryFilter(std::regex("SECURITY.*"));
    fd::Log::SetVerbosity(fd::Log::Kind::Warning);
    fd::Log::RegisterConsumer(std::make_unique<LogReader>());
  });
}

// Why the library has just refused a certificate. The log has a thread of its own, so what was written before is
// waited for.
std::string TakeCertificateFault() {
  fd::Log::Flush();
  LibraryLog& log = Library();
  const MutexLock lock(log.mutex);
  return std::exchange(log.certificate_fault, {});
}

std::string AddressOf(const rtps::ParticipantProxyData& peer) {
  for (const auto* locators : {&peer.metatraffic_locators, &peer.default_locators}) {
    for (const rtps::Locator_t& locator : locators->unicast) return rtps::IPLocator::toIPv4string(locator);
  }
  return "an unknown address";
}

std::string TextOf(const PeerWatch::Guid& guid) {
  std::ostringstream text;
  text << guid.guidPrefix;
  return text.str();
}

}  // namespace

std::shared_ptr<PeerWatch> PeerWatch::Make(bool secure) {
  auto watch = std::make_shared<PeerWatch>(secure);
  if (!secure) return watch;
  ReadLibraryLogOnce();
  LibraryLog& log = Library();
  const MutexLock lock(log.mutex);
  std::erase_if(log.watches, [](const auto& other) { return other.expired(); });
  log.watches.push_back(watch);
  return watch;
}

void PeerWatch::on_participant_discovery(Participant*, rtps::ParticipantDiscoveryInfo&& info) {
  if (!secure_) return;
  const Guid& guid = info.info.m_guid;
  const MutexLock lock(mutex_);
  if (info.status == rtps::ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
      info.status == rtps::ParticipantDiscoveryInfo::DROPPED_PARTICIPANT) {
    peers_.erase(guid);
    return;
  }
  if (info.status != rtps::ParticipantDiscoveryInfo::DISCOVERED_PARTICIPANT || peers_.contains(guid)) return;
  Forget(guid);
  MakeRoom();
  if (peers_.size() >= kMaxPeers) return;
  peers_[guid] = {.address = AddressOf(info.info), .since = Clock::now()};
  if (info.info.identity_token_.is_nil()) Refuse(guid, "it has no identity: it runs without DDS Security");
}

void PeerWatch::onParticipantAuthentication(Participant*, rtps::ParticipantAuthenticationInfo&& info) {
  if (!secure_) return;
  if (info.status == rtps::ParticipantAuthenticationInfo::AUTHORIZED_PARTICIPANT) {
    const MutexLock lock(mutex_);
    peers_[info.guid].authorized = true;
    return;
  }
  const std::string fault = TakeCertificateFault();
  const MutexLock lock(mutex_);
  Refuse(info.guid, "its identity is not valid" + (fault.empty() ? "" : ": " + fault));
}

void PeerWatch::on_publisher_discovery(Participant*, rtps::WriterDiscoveryInfo&& info) {
  if (!secure_ || info.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER) return;
  const auto& partitions = info.info.m_qos.m_partition;
  const std::string robot = partitions.size() == 1 ? partitions.begin()->name() : "";
  const MutexLock lock(mutex_);
  if (const auto known = robots_.find(info.info.guid()); known != robots_.end()) {
    if (known->second != robot) known->second.clear();
    return;
  }
  if (robots_.size() >= kMaxWriters) {
    std::erase_if(robots_, [this](const auto& writer) CAIRN_REQUIRES(mutex_) {
      return !peers_.contains(Guid(writer.first.guidPrefix, rtps::c_EntityId_RTPSParticipant));
    });
    if (robots_.size() >= kMaxWriters) return;
  }
  // Access control has compared the partition that a writer has at first, and not a later one.
  const bool compared = info.status == rtps::WriterDiscoveryInfo::DISCOVERED_WRITER;
  robots_.emplace(info.info.guid(), compared ? robot : "");
}

// A stranger can announce any number of participants without an identity. They make room for those of the fleet.
void PeerWatch::MakeRoom() {
  if (peers_.size() >= kMaxPeers) std::erase_if(peers_, [](const auto& peer) { return !peer.second.authorized; });
}

// What was known of an earlier participant with the same GUID.
void PeerWatch::Forget(const Guid& participant) {
  const auto of_participant = [&](const Guid& writer) { return writer.guidPrefix == participant.guidPrefix; };
  std::erase_if(robots_, [&](const auto& writer) { return of_participant(writer.first); });
  std::erase_if(named_, of_participant);
}

bool PeerWatch::MaySpeakFor(const Guid& writer, NameId robot) {
  if (!secure_) return true;
  const MutexLock lock(mutex_);
  const auto known = robots_.find(writer);
  const std::string own = known == robots_.end() ? "" : known->second;
  if (!own.empty() && HashName(own) == robot) return true;
  ++refusals_.samples;
  SayOf(writer,
        "samples of " + TextOf(writer) + " are refused: it writes in the name of another robot than '" + own + "'");
  return false;
}

Refusals PeerWatch::refusals(Clock::time_point now) {
  const MutexLock lock(mutex_);
  for (auto& [guid, peer] : peers_) {
    if (!peer.authorized && !peer.refused && now - peer.since > kPatience)
      Refuse(guid, "it has not proved an identity of this fleet");
  }
  refusals_.secure = secure_;
  return refusals_;
}

std::vector<std::string> PeerWatch::TakeLines() {
  const MutexLock lock(mutex_);
  return std::exchange(lines_, {});
}

// The handshake is tried again and again. Each peer is counted and said once.
void PeerWatch::Refuse(const Guid& guid, const std::string& reason) {
  if (!peers_.contains(guid)) MakeRoom();
  Peer& peer = peers_[guid];
  if (std::exchange(peer.refused, true)) return;
  ++refusals_.peers;
  Say("peer " + TextOf(guid) + " at " + (peer.address.empty() ? "an unknown address" : peer.address) +
      " is refused: " + reason);
}

void PeerWatch::SayOf(const Guid& endpoint, const std::string& line) {
  if (named_.size() >= kMaxWriters) named_.clear();
  if (named_.insert(endpoint).second) Say(line);
}

void PeerWatch::Say(const std::string& line) {
  const auto now = Clock::now();
  const double waited_s = std::chrono::duration<double>(now - std::exchange(allowed_at_, now)).count();
  lines_allowed_ = std::min(kMaxLines, lines_allowed_ + waited_s * kLinesPerSecond);
  if (lines_allowed_ < 1.0 || lines_.size() >= static_cast<std::size_t>(kMaxLines)) return;
  lines_allowed_ -= 1.0;
  lines_.push_back(line);
}

void PeerWatch::OnLibraryError(const std::string& message) {
  // The texts of Fast DDS 2.9: `Error checking create remote writer <GUID> (<reason>)`, the same of a reader, and
  // `Error validating remote permissions for <GUID> (<reason>).`
  static const std::regex kText(
      "Error (checking create remote (?:writer|reader)|validating remote permissions for|"
      "checking remote participant) +([0-9a-f.|]+) \\((.*?)(?:\\)\\.? ?)?");
  std::smatch parts;
  // A member may have chosen a part of the text. The expression takes a part of the stack for each character.
  std::string text = message.substr(0, kMaxText);
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7F; }, ' ');
  if (!std::regex_match(text, parts, kText)) return;
  Guid guid;
  std::istringstream(parts[2].str()) >> guid;
  const MutexLock lock(mutex_);
  if (parts[1].str().rfind("checking create", 0) != 0) {
    Refuse(Guid(guid.guidPrefix, rtps::c_EntityId_RTPSParticipant), parts[3].str());
    return;
  }
  ++refusals_.endpoints;
  SayOf(guid, "an endpoint of " + TextOf(guid) + " is refused: " + parts[3].str());
}

}  // namespace cairn::wire
