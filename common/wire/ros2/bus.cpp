#include "common/wire/ros2/bus.h"

#include <atomic>
#include <exception>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <thread>
#include <utility>

#include "common/mutex.h"
#include "common/wire/ros2/convert.h"
#include "common/wire/ros2/message_types.h"
#include "common/wire/ros2/participant.h"
#include "common/wire/ros2/writer_list.h"

namespace cairn::ros2 {
namespace {

using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

// Memory may be short: it gets a moment.
constexpr std::chrono::milliseconds kPauseAfterFailure{10};

// Whether `act` ended without an exception.
template <typename Act>
bool Try(const Act& act, const std::function<void(const std::exception&)>& failed) {
  try {
    act();
    return true;
  } catch (const std::exception& error) {
    failed(error);
  }
  std::this_thread::sleep_for(kPauseAfterFailure);
  return false;
}

template <typename Message>
class MessageReader final : public Reader {
  using Wire = typename MessageType<Message>::Wire;

 public:
  using OnMessage = std::function<void(Message&&, const Origin&)>;
  MessageReader(std::shared_ptr<Participant> participant, OnMessage on_message)
      : participant_(std::move(participant)), on_message_(std::move(on_message)) {
    participant_->ready().MakeRoom();
  }
  ~MessageReader() override {
    if (reader_ != nullptr) {
      const MutexLock lock(participant_->endpoints());
      participant_->subscriber()->delete_datareader(reader_);
    }
    participant_->ready().Remove(this);
  }

  Result<void> Open(const std::string& name, const Qos& wanted) {
    auto topic = participant_->TopicFor(name, type_);
    if (!topic) return tl::unexpected(topic.error());
    topic_ = *std::move(topic);
    fd::DataReaderQos qos;
    SetCommon(wanted, qos);
    qos.reliable_reader_qos().times.heartbeatResponseDelay = Duration_t(0.001);
    SetUserData(qos.user_data(), std::string("typehash=RIHS01_") + MessageType<Message>::kHash + ";");
    const MutexLock lock(participant_->endpoints());
    reader_ = participant_->subscriber()->create_datareader(topic_.get(), qos, this);
    if (reader_ == nullptr) return tl::unexpected(Broken("a reader of " + name));
    participant_->ready().Add(this);  // What came before the pointer was there.
    return {};
  }

  bool TakeAll() override {
    wire::Sample<Wire> sample;
    fd::SampleInfo info;
    for (int taken = 0; taken < kMostAtOnce; ++taken) {
      if (reader_->take_next_sample(&sample, &info) != ReturnCode_t::RETCODE_OK) return false;
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
    return true;
  }

  std::uint64_t refused() const override { return refused_.load(std::memory_order_relaxed); }

 private:
  void on_data_available(fd::DataReader* /*reader*/) override { participant_->ready().Add(this); }

  const std::shared_ptr<Participant> participant_;
  const OnMessage on_message_;
  const fd::TypeSupport type_{new typename MessageType<Message>::Type()};
  std::atomic<std::uint64_t> refused_{0};
  TopicUse topic_;  // Until the reader is deleted.
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
    auto topic = participant_->TopicFor(name, type_);
    if (!topic) return tl::unexpected(topic.error());
    topic_ = *std::move(topic);
    fd::DataWriterQos qos;
    SetCommon(wanted, qos);
    qos.publish_mode().kind = fd::SYNCHRONOUS_PUBLISH_MODE;
    auto& times = qos.reliable_writer_qos().times;
    times.initialHeartbeatDelay = Duration_t(0.01);
    times.heartbeatPeriod = Duration_t(0.02);
    times.nackResponseDelay = Duration_t(0.002);
    SetUserData(qos.user_data(), std::string("typehash=RIHS01_") + MessageType<Message>::kHash + ";");
    const MutexLock lock(participant_->endpoints());
    writer_ = participant_->publisher()->create_datawriter(topic_.get(), qos);
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
  TopicUse topic_;  // Until the writer is deleted.
  fd::DataWriter* writer_ = nullptr;
};

class DdsBus final : public Bus {
 public:
  explicit DdsBus(std::shared_ptr<Participant> participant) : participant_(std::move(participant)) {}
  const std::shared_ptr<Participant>& participant() const { return participant_; }

  void Run(const std::stop_token& stop, const std::function<void()>& tick, std::chrono::milliseconds period,
           const std::function<void(const std::exception&)>& failed) override {
    const std::stop_callback wake(stop, [this] { participant_->ready().Wake(); });
    auto next = std::chrono::steady_clock::now();
    while (!stop.stop_requested()) {
      Reader* const reader = participant_->ready().Next(stop, next);
      bool more = true;  // Also where an exception comes between.
      if (reader != nullptr) static_cast<void>(Try([&] { more = reader->TakeAll(); }, failed));
      if (reader != nullptr && more) participant_->ready().Add(reader);
      if (std::chrono::steady_clock::now() < next) continue;
      static_cast<void>(Try(tick, failed));
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

}  // namespace

// The cast is safe because Create makes no other class.
const std::shared_ptr<Participant>& ParticipantOf(const Bus& bus) {
  return static_cast<const DdsBus&>(bus).participant();
}

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
