// A typed reader of one topic with a thread of its own. The middleware's threads only wake this thread. It
// takes the samples, checks their bounds, converts them and runs the callback without holding a lock of the
// middleware, so a slow callback delays only its own topic.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <type_traits>
#include <utility>

#include "common/wire/bounds.h"
#include "common/wire/convert.h"
#include "common/wire/participant.h"
#include "common/wire/reader_events.h"
#include "common/wire/writer_clients.h"

namespace cairn::wire {

template <typename Value>
class DdsSubscription final : public Subscription {
  using Wire = typename Topic<Value>::Wire;

 public:
  [[nodiscard]] static Result<std::unique_ptr<Subscription>> Make(const std::shared_ptr<Participant>& participant,
                                                                  std::function<void(Value&&)> on_value,
                                                                  SubscriptionEvents events,
                                                                  std::optional<std::uint64_t> only = {}) {
    auto made = std::make_unique<DdsSubscription>(std::move(on_value), std::move(events), only);
    Result<Participant::Reader> reader =
        participant->MakeReader(Topic<Value>::kProfile, made->type_, &made->listener_, only);
    if (!reader) return tl::unexpected(reader.error());
    made->participant_ = participant;
    made->reader_ = std::move(*reader);
    made->thread_ = std::thread([self = made.get()] { self->Run(); });
    return made;
  }

  DdsSubscription(std::function<void(Value&&)> on_value, SubscriptionEvents events, std::optional<std::uint64_t> only)
      : on_value_(std::move(on_value)), events_(std::move(events)), only_(only) {}

  ~DdsSubscription() override {
    listener_.Stop();
    if (thread_.joinable()) thread_.join();
  }

  int matched() const override { return listener_.matched(); }
  std::uint64_t refused() const override { return refused_.load(std::memory_order_relaxed); }

 private:
  void Run() {
    while (std::optional<ReaderNews> news = listener_.Wait()) {
      try {
        TakeAll();
        Tell(*news);
        if (news->full) MakeReaderAnew();
      } catch (const std::exception&) {  // For example, no memory for a sample. The next one wakes this thread again.
        refused_.fetch_add(1, std::memory_order_relaxed);
      }
    }
  }

  // Fast DDS 2.9 keeps instances of which no sample was delivered for ever. When forged samples have filled its table,
  // it refuses everything of a robot that it does not know. A new reader has an empty table.
  void MakeReaderAnew() {
    const auto now = std::chrono::steady_clock::now();
    if (now - made_ < kShortestLife) return;
    Result<Participant::Reader> reader = participant_->MakeReader(Topic<Value>::kProfile, type_, &listener_, only_);
    if (!reader) return;  // The next sample that is refused asks again.
    TakeAll();            // What has arrived meanwhile would be lost with the old reader.
    made_ = now;
    reader_ = std::move(*reader);
  }

  void TakeAll() {
    Sample<Wire> sample;
    fd::SampleInfo info;
    for (;;) {
      sample.only = only_;
      if (reader_->take_next_sample(&sample, &info) != eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) return;
      if (!info.valid_data || sample.decoding == Decoding::kForeign) continue;
      if (sample.decoding == Decoding::kUndecodable || !CheckBounds(sample.value)) {
        refused_.fetch_add(1, std::memory_order_relaxed);
        continue;
      }
      if (!SpeaksForItself(sample.value, info.publication_handle)) continue;
      try {
        Deliver(Value{FromWire(std::move(sample.value))}, info.publication_handle);
      } catch (const std::exception&) {  // Of the receiver; the other samples are still delivered.
        refused_.fetch_add(1, std::memory_order_relaxed);
      }
    }
  }

  // A sample of a robot's stream must be about the robot that its writer belongs to.
  bool SpeaksForItself(const Wire& sample, const WriterClients::Writer& writer) {
    if constexpr (Topic<Value>::kProfile.partitions == Partitions::kRobots) {
      return participant_->peers().MaySpeakFor(eprosima::fastrtps::rtps::iHandle2GUID(writer), sample.robot_id());
    } else {
      return true;
    }
  }

  void Deliver(Value&& value, const WriterClients::Writer& writer) {
    if constexpr (std::is_same_v<Value, SessionRequest>) {
      const WriterClients::Speaker speaker{value.client, HashName(value.robot)};
      on_value_(std::move(value));
      // The lease may have run out before the request was taken.
      if (!clients_.Seen(writer, speaker) && events_.liveliness)
        events_.liveliness(speaker.client, speaker.robot_id, false);
    } else {
      if constexpr (std::is_same_v<Value, Request>) value.asker = ParticipantOf(writer);
      if constexpr (std::is_same_v<Value, Command>) value.request.asker = ParticipantOf(writer);
      on_value_(std::move(value));
    }
  }

  static std::uint64_t ParticipantOf(const WriterClients::Writer& writer) {
    const auto prefix = eprosima::fastrtps::rtps::iHandle2GUID(writer).guidPrefix;
    return HashName({reinterpret_cast<const char*>(prefix.value), sizeof(prefix.value)});
  }

  void Tell(const ReaderNews& news) {
    if (news.matched && events_.matched) events_.matched(*news.matched);
    if (news.lost_total && events_.lost) events_.lost(*news.lost_total);
    if (news.incompatible_policy && events_.incompatible_qos) events_.incompatible_qos(*news.incompatible_policy);
    if constexpr (std::is_same_v<Value, SessionRequest>) {
      for (const LivelinessChange& change : news.liveliness) {
        for (const WriterClients::Speaker& speaker : clients_.Changed(change)) {
          if (events_.liveliness) events_.liveliness(speaker.client, speaker.robot_id, change.alive);
        }
      }
    }
  }

  static constexpr std::chrono::seconds kShortestLife{1};

  const std::function<void(Value&&)> on_value_;
  const SubscriptionEvents events_;
  const std::optional<std::uint64_t> only_;
  std::atomic<std::uint64_t> refused_ = 0;
  std::shared_ptr<Participant> participant_;
  const fd::TypeSupport type_{new typename Topic<Value>::Type()};
  WriterClients clients_;  // Used only on the subscription's thread.
  ReaderEvents listener_;
  std::chrono::steady_clock::time_point made_{};  // When the reader was made anew.
  Participant::Reader reader_;                    // After the listener, which it calls until it is destroyed.
  std::thread thread_;
};

}  // namespace cairn::wire
