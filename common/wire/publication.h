// A typed writer of one topic. Thread-safe.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <type_traits>

#include "common/wire/bounds.h"
#include "common/wire/convert.h"
#include "common/wire/participant.h"

namespace cairn::wire {

template <typename Value>
class DdsPublication final : public Publication<Value>, private fd::DataWriterListener {
  using Wire = typename Topic<Value>::Wire;

 public:
  [[nodiscard]] static Result<std::unique_ptr<Publication<Value>>> Make(
      const std::shared_ptr<Participant>& participant) {
    auto made = std::make_unique<DdsPublication>();
    Result<Participant::Writer> writer = participant->MakeWriter(Topic<Value>::kProfile, made->type_, made.get());
    if (!writer) return tl::unexpected(writer.error());
    made->writer_ = std::move(*writer);
    return made;
  }

  Result<void> Publish(const Value& value) override {
    if constexpr (std::is_same_v<Value, TileSample>) {
      if (!FitsTileKey(value.tile.key)) return Fail(StatusCode::kOutOfRange, "tile: coordinates beyond 16 bits");
    }
    Sample<Wire> sample;
    sample.value = ToWire(value);
    if (Result<void> bounds = CheckBounds(sample.value); !bounds) return bounds;
    const std::size_t bytes = Wire::getCdrSerializedSize(sample.value);
    if (bytes > kMaxSampleBytes) {
      return Fail(StatusCode::kOutOfRange, std::string(Topic<Value>::kProfile.name) + ": " + std::to_string(bytes) +
                                               " bytes, at most " + std::to_string(kMaxSampleBytes));
    }
    if (!writer_->write(&sample)) {
      return Fail(StatusCode::kUnavailable,
                  std::string(Topic<Value>::kProfile.name) + ": the writer's history is full");
    }
    return {};
  }

  Result<void> Retire(const Value& value) override {
    Sample<Wire> sample;
    sample.value = ToWire(value);
    using eprosima::fastrtps::types::ReturnCode_t;
    const ReturnCode_t done = writer_->unregister_instance(&sample, fd::HANDLE_NIL);
    if (done == ReturnCode_t::RETCODE_OK) return {};
    const std::string name = Topic<Value>::kProfile.name;
    if (done == ReturnCode_t::RETCODE_PRECONDITION_NOT_MET)
      return Fail(StatusCode::kNotFound, name + ": no such instance");
    return Fail(StatusCode::kUnavailable, name + ": the instance was not unregistered");
  }

  bool WaitForAcknowledgement(std::chrono::milliseconds deadline) override {
    return writer_->wait_for_acknowledgments(eprosima::fastrtps::Duration_t(deadline.count() * 1e-3L)) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
  }

  int matched() const override { return matched_.load(); }

 private:
  void on_publication_matched(fd::DataWriter*, const fd::PublicationMatchedStatus& status) override {
    matched_.store(status.current_count);
  }

  std::atomic<int> matched_ = 0;
  const fd::TypeSupport type_{new typename Topic<Value>::Type()};
  Participant::Writer writer_;  // The last member: it calls the listener until it is destroyed.
};

}  // namespace cairn::wire
