// The writers that discovery has told of, kept in step by the middleware's callbacks. At most Bus::kMaxWriters, so that
// nobody fills the memory with announcements. Thread-safe. This header uses the Fast DDS 2.x API; include it only
// inside common/wire.
#pragma once

#include <atomic>
#include <cstdint>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <map>
#include <vector>

#include "common/mutex.h"
#include "common/wire/ros2/bus.h"

namespace cairn::ros2 {

class WriterList final : public eprosima::fastdds::dds::DomainParticipantListener {
 public:
  [[nodiscard]] std::vector<RemoteWriter> writers() const;
  [[nodiscard]] std::uint64_t version() const { return version_.load(std::memory_order_acquire); }

 private:
  using Participant = eprosima::fastdds::dds::DomainParticipant;
  void on_participant_discovery(Participant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void on_publisher_discovery(Participant* participant, eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;

  mutable Mutex mutex_;
  std::map<WriterId, RemoteWriter> writers_ CAIRN_GUARDED_BY(mutex_);
  std::atomic<std::uint64_t> version_{0};
};

// The 16 bytes of a GUID.
[[nodiscard]] WriterId IdOf(const eprosima::fastrtps::rtps::GUID_t& guid);

}  // namespace cairn::ros2
