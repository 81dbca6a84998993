#include "common/wire/ros2/writer_list.h"

#include <algorithm>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <string>
#include <string_view>
#include <utility>

namespace cairn::ros2 {
namespace {

namespace fd = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

constexpr std::size_t kMaxName = 255;

// Names are shown to people: what is no name of ROS becomes a name that fits no rule.
std::string Printable(const std::string& name) {
  std::string shown = name.substr(0, kMaxName);
  for (char& c : shown)
    if (c <= ' ' || c > '~') c = '?';
  return shown;
}

// The value of `key` in user data such as "enclave=/;" or "typehash=RIHS01_0123;".
std::string Find(const std::string& user_data, std::string_view key) {
  const std::size_t at = user_data.find(std::string(key) + "=");
  if (at == std::string::npos) return {};
  const std::size_t begin = at + key.size() + 1;
  return Printable(user_data.substr(begin, std::min(user_data.find(';', begin), user_data.size()) - begin));
}

RemoteWriter Describe(const rtps::WriterProxyData& data) {
  const auto& bytes = data.m_qos.m_userData.data_vec();
  return {.id = IdOf(data.guid()),
          .topic = Printable(data.topicName().to_string()),
          .type = Printable(data.typeName().to_string()),
          .reliable = data.m_qos.m_reliability.kind == fd::RELIABLE_RELIABILITY_QOS,
          .transient_local = data.m_qos.m_durability.kind >= fd::TRANSIENT_LOCAL_DURABILITY_QOS,
          .type_hash = Find(std::string(bytes.begin(), bytes.end()), "typehash")};
}

}  // namespace

WriterId IdOf(const rtps::GUID_t& guid) {
  WriterId id{};
  std::copy_n(guid.guidPrefix.value, 12, id.begin());
  std::copy_n(guid.entityId.value, 4, id.begin() + 12);
  return id;
}

std::vector<RemoteWriter> WriterList::writers() const {
  const MutexLock lock(mutex_);
  std::vector<RemoteWriter> all;
  all.reserve(writers_.size());
  for (const auto& [id, writer] : writers_) all.push_back(writer);
  return all;
}

void WriterList::on_participant_discovery(Participant* /*participant*/, rtps::ParticipantDiscoveryInfo&& info) {
  if (info.status != rtps::ParticipantDiscoveryInfo::REMOVED_PARTICIPANT &&
      info.status != rtps::ParticipantDiscoveryInfo::DROPPED_PARTICIPANT) {
    return;
  }
  const WriterId id = IdOf(info.info.m_guid);
  const MutexLock lock(mutex_);
  const auto of_participant = [&id](const auto& writer) {
    return std::equal(id.begin(), id.begin() + 12, writer.first.begin());
  };
  if (std::erase_if(writers_, of_participant) > 0) version_.fetch_add(1, std::memory_order_release);
}

void WriterList::on_publisher_discovery(Participant* participant, rtps::WriterDiscoveryInfo&& info) {
  if (info.info.guid().guidPrefix == participant->guid().guidPrefix) return;
  const WriterId id = IdOf(info.info.guid());
  const MutexLock lock(mutex_);
  if (info.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER) {
    writers_.erase(id);
  } else if (writers_.size() < Bus::kMaxWriters || writers_.contains(id)) {
    writers_.insert_or_assign(id, Describe(info.info));
  } else {
    return;
  }
  version_.fetch_add(1, std::memory_order_release);
}

}  // namespace cairn::ros2
