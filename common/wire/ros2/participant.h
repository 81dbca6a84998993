// What the endpoints of the ROS 2 wire share: the participant with its topics, the readers that have something to take,
// and the QoS of every endpoint. Thread-safe, except for Reader (bus.h). This header uses the Fast DDS 2.x API; include
// it only inside common/wire.
#pragma once

#include <algorithm>
#include <chrono>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "common/wire/guard_transport.h"
#include "common/wire/ros2/bus.h"
#include "common/wire/ros2/writer_list.h"

namespace cairn::ros2 {

namespace fd = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

[[nodiscard]] inline Status Broken(const std::string& what) {
  return {StatusCode::kInternal, "Fast DDS refused to make " + what};
}

template <typename Policy>
void SetUserData(Policy& policy, const std::string& text) {
  policy.data_vec(std::vector<rtps::octet>(text.begin(), text.end()));
}

// Every limit is set, and the memory of a sample is taken when it arrives (idl/README.md).
template <typename EndpointQos>
void SetCommon(const Qos& wanted, EndpointQos& qos) {
  qos.reliability().kind = wanted.reliable ? fd::RELIABLE_RELIABILITY_QOS : fd::BEST_EFFORT_RELIABILITY_QOS;
  qos.reliability().max_blocking_time = eprosima::fastrtps::Duration_t(0.1);
  qos.durability().kind = wanted.transient_local ? fd::TRANSIENT_LOCAL_DURABILITY_QOS : fd::VOLATILE_DURABILITY_QOS;
  qos.history().kind = fd::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = wanted.depth;
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().max_samples_per_instance = wanted.depth;
  qos.resource_limits().max_samples = wanted.depth;
  qos.resource_limits().allocated_samples = 1;
  qos.data_sharing().off();
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
}

class Reader;

// The readers that have something to take. Thread-safe.
class ReadyReaders {
 public:
  // Makes room for one reader more, so that Add never needs memory: the middleware calls it.
  void MakeRoom() {
    const MutexLock lock(mutex_);
    ready_.reserve(++readers_);
  }
  // REQUIRES: there is room for this reader.
  void Add(Reader* reader) {
    const MutexLock lock(mutex_);
    if (std::find(ready_.begin(), ready_.end(), reader) == ready_.end()) ready_.push_back(reader);
    filled_.NotifyOne();
  }
  // The reader goes, and its room with it.
  void Remove(Reader* reader) {
    const MutexLock lock(mutex_);
    std::erase(ready_, reader);
    --readers_;
  }
  // One of them, or null at the deadline or once a stop is requested.
  Reader* Next(const std::stop_token& stop, std::chrono::steady_clock::time_point deadline) {
    const MutexLock lock(mutex_);
    while (ready_.empty() && !stop.stop_requested() && filled_.WaitUntil(mutex_, deadline)) {
    }
    if (ready_.empty() || stop.stop_requested()) return nullptr;
    Reader* const reader = ready_.front();
    ready_.erase(ready_.begin());
    return reader;
  }
  void Wake() {
    const MutexLock lock(mutex_);
    filled_.NotifyAll();
  }

 private:
  Mutex mutex_;
  CondVar filled_;
  std::vector<Reader*> ready_ CAIRN_GUARDED_BY(mutex_);
  std::size_t readers_ CAIRN_GUARDED_BY(mutex_) = 0;
};

// A reader of one topic. TakeAll hands on what has come, on the thread of Bus::Run. It may throw, as the callback may:
// the sample is then lost, and the rest stays.
class Reader : public Subscription, protected fd::DataReaderListener {
 public:
  // Whether it stopped after kMostAtOnce samples, with more to take: others have their turn before.
  [[nodiscard]] virtual bool TakeAll() = 0;
  static constexpr int kMostAtOnce = 64;
};

class Participant;

// An endpoint's use of a topic, which is deleted with its last use. Outlived by the participant.
class TopicUse {
 public:
  TopicUse() = default;
  TopicUse(Participant& participant, fd::Topic* topic) : participant_(&participant), topic_(topic) {}
  TopicUse(TopicUse&& other) noexcept { *this = std::move(other); }
  TopicUse& operator=(TopicUse&& other) noexcept {
    std::swap(participant_, other.participant_);
    std::swap(topic_, other.topic_);
    return *this;
  }
  ~TopicUse();
  [[nodiscard]] fd::Topic* get() const { return topic_; }

 private:
  Participant* participant_ = nullptr;
  fd::Topic* topic_ = nullptr;
};

// The participant and its topics. Endpoints keep it alive.
class Participant {
 public:
  Participant() = default;
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;
  [[nodiscard]] static Result<std::shared_ptr<Participant>> Create(const WireOptions& options, const std::string& name);

  // The topic of this name. FAILED_PRECONDITION: it is in use with another type.
  [[nodiscard]] Result<TopicUse> TopicFor(const std::string& name, const fd::TypeSupport& type) CAIRN_EXCLUDES(mutex_);

  fd::Publisher* publisher() const { return publisher_; }
  fd::Subscriber* subscriber() const { return subscriber_; }
  const WriterList& writers() const { return writers_; }
  ReadyReaders& ready() { return ready_; }
  // Held while an endpoint is made or deleted, as in common/wire/participant.h.
  Mutex& endpoints() { return endpoints_; }
  std::uint64_t datagrams_refused() const {
    return std::accumulate(guard_->refused.begin(), guard_->refused.end(), std::uint64_t{0});
  }
  std::chrono::nanoseconds busy_with_one_datagram() const {
    return guard_->receiving.Longest(wire::ReceiveWatch::Clock::now());
  }

 private:
  const std::shared_ptr<wire::GuardReport> guard_ = std::make_shared<wire::GuardReport>();
  WriterList writers_;  // The participant's listener.
  ReadyReaders ready_;
  Mutex endpoints_;
  Mutex mutex_;
  friend class TopicUse;
  void EndUse(fd::Topic* topic) CAIRN_EXCLUDES(mutex_);
  struct UsedTopic {
    fd::Topic* topic = nullptr;
    int uses = 0;
  };
  std::map<std::string, UsedTopic> topics_ CAIRN_GUARDED_BY(mutex_);
  fd::DomainParticipant* participant_ = nullptr;
  fd::Publisher* publisher_ = nullptr;
  fd::Subscriber* subscriber_ = nullptr;
};

// The participant of a bus that Bus::Create has made.
[[nodiscard]] const std::shared_ptr<Participant>& ParticipantOf(const Bus& bus);

}  // namespace cairn::ros2
