// The part of Bus that serves services.
#include "common/ros2/services.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <set>
#include <string>
#include <type_traits>
#include <utility>

#include "common/mutex.h"
#include "common/wire/ros2/participant.h"
#include "common/wire/ros2/service_endpoint.h"

namespace cairn::ros2 {
namespace {

using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

// Requests that may wait for the thread of the bus, and answers that may wait for a reader that is slow.
constexpr Qos kRequestQos{.reliable = true, .transient_local = false, .depth = 64};
constexpr int kAnswers = 10;
constexpr int kAnswersWithMaps = 2;  // Each may have megabytes.

std::string UserData(const char* hash) {
  return std::string("typehash=RIHS01_") + hash + ";";
}

rtps::GUID_t GuidOf(const WriterId& id) {
  rtps::GUID_t guid;
  std::copy_n(id.begin(), 12, guid.guidPrefix.value);
  std::copy_n(id.begin() + 12, 4, guid.entityId.value);
  return guid;
}

Caller CallerOf(const fd::SampleInfo& info) {
  Caller caller;
  caller.writer = IdOf(info.sample_identity.writer_guid());
  const rtps::GUID_t& reader = info.related_sample_identity.writer_guid();
  caller.answer_to = reader == rtps::GUID_t::unknown() ? caller.writer : IdOf(reader);
  caller.sequence = static_cast<std::int64_t>(info.sample_identity.sequence_number().to64long());
  caller.in_message = IsOfCyclone(caller.writer);
  return caller;
}

template <typename S>
class RequestReader final : public Reader {
 public:
  using OnRequest = std::function<void(typename S::Request&&, const Caller&)>;
  RequestReader(std::shared_ptr<Participant> participant, OnRequest on_request)
      : participant_(std::move(participant)), on_request_(std::move(on_request)) {
    participant_->ready().MakeRoom();
  }
  ~RequestReader() override {
    if (reader_ != nullptr) {
      const MutexLock lock(participant_->endpoints());
      participant_->subscriber()->delete_datareader(reader_);
    }
    participant_->ready().Remove(this);
  }

  Result<void> Open(const std::string& service) {
    const std::string name = "rq" + service + "Request";
    auto topic = participant_->TopicFor(name, type_);
    if (!topic) return tl::unexpected(topic.error());
    topic_ = *std::move(topic);
    fd::DataReaderQos qos;
    SetCommon(kRequestQos, qos);
    qos.reliable_reader_qos().times.heartbeatResponseDelay = Duration_t(0.001);
    SetUserData(qos.user_data(), UserData(ServiceType<S>::kRequestHash));
    const MutexLock lock(participant_->endpoints());
    reader_ = participant_->subscriber()->create_datareader(topic_.get(), qos, this);
    if (reader_ == nullptr) return tl::unexpected(Broken("a reader of " + name));
    participant_->ready().Add(this);  // What came before the pointer was there.
    return {};
  }

  bool TakeAll() override {
    RequestBytes sample;
    fd::SampleInfo info;
    for (int taken = 0; taken < kMostAtOnce; ++taken) {
      if (reader_->take_next_sample(&sample, &info) != ReturnCode_t::RETCODE_OK) return false;
      if (!info.valid_data) continue;
      Caller caller = CallerOf(info);
      auto request = DecodeRequest<S>(sample.bytes, caller);
      if (request) {
        on_request_(*std::move(request), caller);
      } else {
        refused_.fetch_add(1, std::memory_order_relaxed);
      }
    }
    return true;
  }

  std::uint64_t refused() const override { return refused_.load(std::memory_order_relaxed); }

 private:
  void on_data_available(fd::DataReader* /*reader*/) override { participant_->ready().Add(this); }

  const std::shared_ptr<Participant> participant_;
  const OnRequest on_request_;
  const fd::TypeSupport type_{new RequestType<S>()};
  std::atomic<std::uint64_t> refused_{0};
  TopicUse topic_;  // Until the reader is deleted.
  fd::DataReader* reader_ = nullptr;
};

// The readers of answers that discovery has matched with a writer.
class MatchedReaders final : public fd::DataWriterListener {
 public:
  // Of a caller whose reader is not named, any reader of its participant.
  [[nodiscard]] bool Has(const Caller& caller) const {
    const MutexLock lock(mutex_);
    if (caller.answer_to != caller.writer) return readers_.contains(caller.answer_to);
    WriterId first = caller.writer;
    std::fill(first.begin() + 12, first.end(), std::uint8_t{0});
    const auto found = readers_.lower_bound(first);
    return found != readers_.end() && std::equal(first.begin(), first.begin() + 12, found->begin());
  }

 private:
  void on_publication_matched(fd::DataWriter* /*writer*/, const fd::PublicationMatchedStatus& status) override {
    const WriterId reader = IdOf(rtps::iHandle2GUID(status.last_subscription_handle));
    const MutexLock lock(mutex_);
    if (status.current_count_change < 0) {
      readers_.erase(reader);
      return;
    }
    try {  // No exception may reach the middleware. A reader that is not remembered gets no answer, and asks again.
      readers_.insert(reader);
    } catch (const std::exception&) {
    }
  }

  mutable Mutex mutex_;
  std::set<WriterId> readers_ CAIRN_GUARDED_BY(mutex_);
};

template <typename S>
class AnswerWriter final : public Answers<S> {
 public:
  explicit AnswerWriter(std::shared_ptr<Participant> participant) : participant_(std::move(participant)) {}
  ~AnswerWriter() override {
    if (writer_ == nullptr) return;
    const MutexLock lock(participant_->endpoints());
    participant_->publisher()->delete_datawriter(writer_);
  }

  Result<void> Open(const std::string& service) {
    const std::string name = "rr" + service + "Reply";
    auto topic = participant_->TopicFor(name, type_);
    if (!topic) return tl::unexpected(topic.error());
    topic_ = *std::move(topic);
    fd::DataWriterQos qos;
    constexpr bool kHasMap = std::is_same_v<S, GetMap> || std::is_same_v<S, LoadMap>;
    SetCommon({.reliable = true, .transient_local = false, .depth = kHasMap ? kAnswersWithMaps : kAnswers}, qos);
    qos.publish_mode().kind = fd::SYNCHRONOUS_PUBLISH_MODE;
    qos.liveliness().kind = fd::MANUAL_BY_TOPIC_LIVELINESS_QOS;  // Send says why.
    auto& times = qos.reliable_writer_qos().times;
    times.initialHeartbeatDelay = Duration_t(0.01);
    times.heartbeatPeriod = Duration_t(0.02);
    times.nackResponseDelay = Duration_t(0.002);
    SetUserData(qos.user_data(), UserData(ServiceType<S>::kResponseHash));
    const MutexLock lock(participant_->endpoints());
    writer_ = participant_->publisher()->create_datawriter(topic_.get(), qos, &readers_,
                                                           fd::StatusMask::publication_matched());
    if (writer_ == nullptr) return tl::unexpected(Broken("a writer of " + name));
    return {};
  }

  bool Reaches(const Caller& caller) const override { return readers_.Has(caller); }

  Result<void> Send(const Caller& caller, const typename S::Response& response) override {
    AnswerSample<S> sample;
    if (caller.in_message) sample.in_front = caller;
    sample.value = ToWire(response);
    rtps::WriteParams params;
    if (!caller.in_message) {
      params.related_sample_identity().writer_guid(GuidOf(caller.answer_to));
      params.related_sample_identity().sequence_number(rtps::SequenceNumber_t(
          static_cast<std::int32_t>(caller.sequence >> 32), static_cast<std::uint32_t>(caller.sequence)));
    }
    // Cyclone DDS skips whatever a volatile writer has sent before the first heartbeat that it sees. The one that Fast
    // DDS sends when it finds a reader may come before that reader has found this writer. Who asks has found it; so a
    // heartbeat goes out first, which an assertion of liveliness is. Without it, one of 60 calls by programs that had
    // just begun got no answer; with it, none of 150.
    static_cast<void>(writer_->assert_liveliness());
    if (writer_->write(&sample, params)) return {};
    return Fail(StatusCode::kUnavailable, writer_->get_topic()->get_name() + ": not accepted");
  }

 private:
  const std::shared_ptr<Participant> participant_;
  const fd::TypeSupport type_{new AnswerType<S>()};
  MatchedReaders readers_;  // The writer's listener.
  TopicUse topic_;          // Until the writer is deleted.
  fd::DataWriter* writer_ = nullptr;
};

}  // namespace

template <typename S>
Result<std::unique_ptr<Subscription>> Bus::SubscribeRequests(
    const std::string& service, std::function<void(typename S::Request&&, const Caller&)> on_request) {
  auto reader = std::make_unique<RequestReader<S>>(ParticipantOf(*this), std::move(on_request));
  if (auto opened = reader->Open(service); !opened) return tl::unexpected(opened.error());
  return reader;
}

template <typename S>
Result<std::unique_ptr<Answers<S>>> Bus::AdvertiseAnswers(const std::string& service) {
  auto writer = std::make_unique<AnswerWriter<S>>(ParticipantOf(*this));
  if (auto opened = writer->Open(service); !opened) return tl::unexpected(opened.error());
  return writer;
}

// The macro's argument is a type and cannot be in parentheses. NOLINTBEGIN(bugprone-macro-parentheses)
#define CAIRN_ROS2_SERVICE(S)                                                \
  template Result<std::unique_ptr<Subscription>> Bus::SubscribeRequests<S>(  \
      const std::string&, std::function<void(S::Request&&, const Caller&)>); \
  template Result<std::unique_ptr<Answers<S>>> Bus::AdvertiseAnswers<S>(const std::string&)
// NOLINTEND(bugprone-macro-parentheses)
CAIRN_ROS2_SERVICE(GetMap);
CAIRN_ROS2_SERVICE(LoadMap);
CAIRN_ROS2_SERVICE(SaveMap);
CAIRN_ROS2_SERVICE(SerializePoseGraph);
CAIRN_ROS2_SERVICE(Pause);
CAIRN_ROS2_SERVICE(Reset);
#undef CAIRN_ROS2_SERVICE

}  // namespace cairn::ros2
