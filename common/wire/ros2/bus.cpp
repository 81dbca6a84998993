#include "common/wire/ros2/bus.h"

#include <algorithm>
#include <atomic>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <numeric>
#include <utility>

#include "common/mutex.h"
#include "common/wire/participant_qos.h"
#include "common/wire/ros2/convert.h"
#include "common/wire/ros2/message_types.h"
#include "common/wire/ros2/writer_list.h"

namespace cairn::ros2 {
namespace {

namespace fd = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

Status Broken(const std::string& what) {
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
  qos.reliability().max_blocking_time = Duration_t(0.1);
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
  void Add(Reader* reader) {
    const MutexLock lock(mutex_);
    if (std::find(ready_.begin(), ready_.end(), reader) == ready_.end()) ready_.push_back(reader);
    filled_.NotifyOne();
  }
  void Remove(Reader* reader) {
    const MutexLock lock(mutex_);
    std::erase(ready_, reader);
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
};

class Participant;

class Reader : public Subscription, protected fd::DataReaderListener {
 public:
  virtual void TakeAll() = 0;
};

// The participant and its topics. Endpoints keep it alive.
class Participant {
 public:
  ~Participant() {
    if (participant_ == nullptr) return;
    participant_->delete_contained_entities();
    fd::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }

  [[nodiscard]] static Result<std::shared_ptr<Participant>> Create(const WireOptions& options,
                                                                   const std::string& name) {
    if (const auto valid = Validate(options); !valid) return tl::unexpected(valid.error());
    if (const auto present = RequireInterfaces(options); !present) return tl::unexpected(present.error());
    wire::ConfigureLibraryOnce();
    auto made = std::make_shared<Participant>();
    fd::DomainParticipantQos qos = wire::ParticipantQos(options, name, made->guard_);
    SetUserData(qos.user_data(), "enclave=/;");
    made->participant_ = fd::DomainParticipantFactory::get_instance()->create_participant(
        static_cast<fd::DomainId_t>(options.domain), qos, &made->writers_, fd::StatusMask::none());
    if (made->participant_ == nullptr) {
      return Fail(StatusCode::kUnavailable, "cannot join the DDS domain " + std::to_string(options.domain) +
                                                " of the ROS 2 robots: no free port or address, or it is full");
    }
    made->publisher_ = made->participant_->create_publisher(fd::PUBLISHER_QOS_DEFAULT);
    made->subscriber_ = made->participant_->create_subscriber(fd::SUBSCRIBER_QOS_DEFAULT);
    if (made->publisher_ == nullptr || made->subscriber_ == nullptr) return tl::unexpected(Broken("a participant"));
    return made;
  }

  // A topic belongs to the endpoint that asked for it first, and stays: there are as many as names in use.
  Result<fd::Topic*> TopicFor(const std::string& name, const fd::TypeSupport& type) {
    const MutexLock lock(mutex_);
    if (const auto known = topics_.find(name); known != topics_.end()) {
      if (known->second->get_type_name() == type.get_type_name()) return known->second;
      return Fail(StatusCode::kFailedPrecondition, name + " is in use with another type");
    }
    if (participant_->find_type(type.get_type_name()).empty() &&
        type.register_type(participant_) != ReturnCode_t::RETCODE_OK) {
      return tl::unexpected(Broken("type " + type.get_type_name()));
    }
    fd::Topic* const topic = participant_->create_topic(name, type.get_type_name(), fd::TOPIC_QOS_DEFAULT);
    if (topic == nullptr) return tl::unexpected(Broken("topic " + name));
    topics_.emplace(name, topic);
    return topic;
  }

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
  std::map<std::string, fd::Topic*> topics_ CAIRN_GUARDED_BY(mutex_);
  fd::DomainParticipant* participant_ = nullptr;
  fd::Publisher* publisher_ = nullptr;
  fd::Subscriber* subscriber_ = nullptr;
};

template <typename Message>
class MessageReader final : public Reader {
  using Wire = typename MessageType<Message>::Wire;

 public:
  using OnMessage = std::function<void(Message&&, const Origin&)>;
  MessageReader(std::shared_ptr<Participant> participant, OnMessage on_message)
      : participant_(std::move(participant)), on_message_(std::move(on_message)) {}
  ~MessageReader() override {
    if (reader_ != nullptr) {
      const MutexLock lock(participant_->endpoints());
      participant_->subscriber()->delete_datareader(reader_);
    }
    participant_->ready().Remove(this);
  }

  Result<void> Open(const std::string& name, const Qos& wanted) {
    const Result<fd::Topic*> topic = participant_->TopicFor(name, type_);
    if (!topic) return tl::unexpected(topic.error());
    fd::DataReaderQos qos;
    SetCommon(wanted, qos);
    qos.reliable_reader_qos().times.heartbeatResponseDelay = Duration_t(0.001);
    SetUserData(qos.user_data(), std::string("typehash=RIHS01_") + MessageType<Message>::kHash + ";");
    const MutexLock lock(participant_->endpoints());
    reader_ = participant_->subscriber()->create_datareader(*topic, qos, this);
    if (reader_ == nullptr) return tl::unexpected(Broken("a reader of " + name));
    participant_->ready().Add(this);  // What came before the pointer was there.
    return {};
  }

  void TakeAll() override {
    wire::Sample<Wire> sample;
    fd::SampleInfo info;
    while (reader_->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      Result<Message> message = sample.decoding == wire::Decoding::kDecoded
                                    ? FromWire(std::move(sample.value))
                                    : Fail(StatusCode::kDataLoss, "not decoded");
      if (!message) {
        refused_.fetch_add(1, std::memory_order_relaxed);
        continue;
      }
      on_message_(*std::move(message), {IdOf(info.sample_identity.writer_guid()),
                                        static_cast<std::int64_t>(info.sample_identity.sequence_number().to64long())});
    }
  }

  std::uint64_t refused() const override { return refused_.load(std::memory_order_relaxed); }

 private:
  void on_data_available(fd::DataReader* /*reader*/) override { participant_->ready().Add(this); }

  const std::shared_ptr<Participant> participant_;
  const OnMessage on_message_;
  const fd::TypeSupport type_{new typename MessageType<Message>::Type()};
  std::atomic<std::uint64_t> refused_{0};
  fd::DataReader* reader_ = nullptr;
};

template <typename Message>
class MessageWriter final : public Publication<Message> {
  using Wire = typename MessageType<Message>::Wire;

 public:
  explicit MessageWriter(std::shared_ptr<Participant> participant) : participant_(std::move(participant)) {}
  ~MessageWriter() override {
    if (writer_ == nullptr) return;
    const MutexLock lock(participant_->endpoints());
    participant_->publisher()->delete_datawriter(writer_);
  }

  Result<void> Open(const std::string& name, const Qos& wanted) {
    const Result<fd::Topic*> topic = participant_->TopicFor(name, type_);
    if (!topic) return tl::unexpected(topic.error());
    fd::DataWriterQos qos;
    SetCommon(wanted, qos);
    qos.publish_mode().kind = fd::SYNCHRONOUS_PUBLISH_MODE;
    auto& times = qos.reliable_writer_qos().times;
    times.initialHeartbeatDelay = Duration_t(0.01);
    times.heartbeatPeriod = Duration_t(0.02);
    times.nackResponseDelay = Duration_t(0.002);
    SetUserData(qos.user_data(), std::string("typehash=RIHS01_") + MessageType<Message>::kHash + ";");
    const MutexLock lock(participant_->endpoints());
    writer_ = participant_->publisher()->create_datawriter(*topic, qos);
    if (writer_ == nullptr) return tl::unexpected(Broken("a writer of " + name));
    return {};
  }

  Result<void> Publish(const Message& message) override {
    wire::Sample<Wire> sample;
    sample.value = ToWire(message);
    if (writer_->write(&sample)) return {};
    return Fail(StatusCode::kUnavailable, writer_->get_topic()->get_name() + ": not accepted");
  }

  int matched() const override {
    fd::PublicationMatchedStatus status;
    static_cast<void>(writer_->get_publication_matched_status(status));
    return status.current_count;
  }

 private:
  const std::shared_ptr<Participant> participant_;
  const fd::TypeSupport type_{new typename MessageType<Message>::Type()};
  fd::DataWriter* writer_ = nullptr;
};

class DdsBus final : public Bus {
 public:
  explicit DdsBus(std::shared_ptr<Participant> participant) : participant_(std::move(participant)) {}
  const std::shared_ptr<Participant>& participant() const { return participant_; }

  void Run(const std::stop_token& stop, const std::function<void()>& tick, std::chrono::milliseconds period) override {
    const std::stop_callback wake(stop, [this] { participant_->ready().Wake(); });
    auto next = std::chrono::steady_clock::now();
    while (!stop.stop_requested()) {
      if (Reader* const reader = participant_->ready().Next(stop, next)) reader->TakeAll();
      if (std::chrono::steady_clock::now() < next) continue;
      tick();
      next = std::chrono::steady_clock::now() + period;
    }
  }

  std::vector<RemoteWriter> writers() const override { return participant_->writers().writers(); }
  std::uint64_t writers_version() const override { return participant_->writers().version(); }
  std::uint64_t datagrams_refused() const override { return participant_->datagrams_refused(); }
  std::chrono::nanoseconds busy_with_one_datagram() const override { return participant_->busy_with_one_datagram(); }

 private:
  const std::shared_ptr<Participant> participant_;
};

// The cast is safe because Create makes no other class.
const std::shared_ptr<Participant>& ParticipantOf(const Bus& bus) {
  return static_cast<const DdsBus&>(bus).participant();
}

}  // namespace

Result<std::unique_ptr<Bus>> Bus::Create(const WireOptions& options, const std::string& name) {
  auto participant = Participant::Create(options, name);
  if (!participant) return tl::unexpected(participant.error());
  return std::make_unique<DdsBus>(*std::move(participant));
}

template <typename Message>
std::string Bus::TypeName() {
  return typename MessageType<Message>::Type().getName();
}

template <typename Message>
Result<std::unique_ptr<Subscription>> Bus::Subscribe(const std::string& topic, const Qos& qos,
                                                     std::function<void(Message&&, const Origin&)> on_message) {
  auto reader = std::make_unique<MessageReader<Message>>(ParticipantOf(*this), std::move(on_message));
  if (auto opened = reader->Open(topic, qos); !opened) return tl::unexpected(opened.error());
  return reader;
}

template <typename Message>
Result<std::unique_ptr<Publication<Message>>> Bus::Advertise(const std::string& topic, const Qos& qos) {
  auto writer = std::make_unique<MessageWriter<Message>>(ParticipantOf(*this));
  if (auto opened = writer->Open(topic, qos); !opened) return tl::unexpected(opened.error());
  return writer;
}

// The macros' argument is a type and cannot be in parentheses. NOLINTBEGIN(bugprone-macro-parentheses)
#define CAIRN_ROS2_WRITTEN(Message)              \
  template std::string Bus::TypeName<Message>(); \
  template Result<std::unique_ptr<Publication<Message>>> Bus::Advertise<Message>(const std::string&, const Qos&)
#define CAIRN_ROS2_READ(Message)                                          \
  CAIRN_ROS2_WRITTEN(Message);                                            \
  template Result<std::unique_ptr<Subscription>> Bus::Subscribe<Message>( \
      const std::string&, const Qos&, std::function<void(Message&&, const Origin&)>)
// NOLINTEND(bugprone-macro-parentheses)
CAIRN_ROS2_READ(LaserScan);
CAIRN_ROS2_READ(Odometry);
CAIRN_ROS2_READ(Transforms);
CAIRN_ROS2_READ(PoseWithCovariance);
CAIRN_ROS2_WRITTEN(Grid);
CAIRN_ROS2_WRITTEN(GridUpdate);
#undef CAIRN_ROS2_READ
#undef CAIRN_ROS2_WRITTEN

}  // namespace cairn::ros2
