// The one type support of all topics: wraps a generated one, so that
// - nothing thrown by decoding reaches the middleware (an unknown encapsulation would end the process): a
//   sample that does not decode is delivered as such, and the reader counts it;
// - keys are computed under a lock (the generated ones share a buffer: wrong keys from two threads,
//   measured);
// - no type objects are announced (Cyclone DDS would refuse the topic);
// - replies to other clients, and what is about other robots, are skipped by their first eight bytes.
// This header uses the Fast DDS 2.x API; include it only inside common/wire.
#pragma once

#include <exception>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <functional>
#include <optional>

#include "common/mutex.h"
#include "common/service/session.h"
#include "common/wire/limits.h"

namespace cairn::wire {

enum class Decoding { kDecoded, kUndecodable, kForeign };

// What readers and writers of a topic pass to the middleware.
template <typename Wire>
struct Sample {
  Wire value;
  Decoding decoding = Decoding::kDecoded;
  std::optional<std::uint64_t> only;  // Set by a reader of one client's replies, or of one robot.
};

// Returns the number at the start of a serialised sample; nothing if the sample is too short or not plain CDR.
[[nodiscard]] inline std::optional<std::uint64_t> PeekFirstNumber(const std::uint8_t* payload, std::uint32_t size) {
  constexpr std::uint8_t kCdrLittleEndian = 1;
  constexpr std::uint32_t kEncapsulationBytes = 4;
  if (size < kEncapsulationBytes + sizeof(std::uint64_t) || payload[0] != 0 || payload[1] > kCdrLittleEndian) return {};
  std::uint64_t number = 0;
  for (std::uint32_t i = 0; i < sizeof(std::uint64_t); ++i) {
    const std::uint32_t at = payload[1] == kCdrLittleEndian ? sizeof(std::uint64_t) - 1 - i : i;
    number = number << 8 | payload[kEncapsulationBytes + at];
  }
  return number;
}

template <typename Wire, typename Generated>
class SampleType : public eprosima::fastdds::dds::TopicDataType {
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;
  using Handle = eprosima::fastrtps::rtps::InstanceHandle_t;

 public:
  SampleType() {
    setName(generated_.getName());
    m_typeSize = generated_.m_typeSize;
    m_isGetKeyDefined = generated_.m_isGetKeyDefined;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  bool serialize(void* data, Payload* payload) override {
    try {
      return generated_.serialize(&Of(data).value, payload);
    } catch (const std::exception&) {
      return false;
    }
  }

  // Always returns true: a sample that cannot be decoded is marked and delivered.
  bool deserialize(Payload* payload, void* data) override {
    Sample<Wire>& sample = Of(data);
    sample.decoding = Decoding::kUndecodable;
    if (payload->length > kMaxSampleBytes) return true;
    if (sample.only) {
      const std::optional<std::uint64_t> first = PeekFirstNumber(payload->data, payload->length);
      if (first && first != sample.only) {
        sample.decoding = Decoding::kForeign;
        return true;
      }
    }
    try {
      if (generated_.deserialize(payload, &sample.value)) sample.decoding = Decoding::kDecoded;
    } catch (const std::exception&) {
      // The sample stays marked as undecodable, and the reader counts it.
    }
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return generated_.getSerializedSizeProvider(&Of(data).value);
  }
  void* createData() override { return new Sample<Wire>(); }
  void deleteData(void* data) override { delete &Of(data); }

  bool getKey(void* data, Handle* handle, bool force_md5) override {
    if (!m_isGetKeyDefined) return false;
    if (Of(data).decoding != Decoding::kDecoded) {
      // All samples that cannot be decoded share one instance. If they were refused, the sender would repeat
      // them for ever.
      for (int i = 0; i < 16; ++i) handle->value[i] = 0xff;
      return true;
    }
    const MutexLock lock(key_mutex_);
    try {
      return generated_.getKey(&Of(data).value, handle, force_md5);
    } catch (const std::exception&) {
      return false;
    }
  }

 private:
  static Sample<Wire>& Of(void* data) { return *static_cast<Sample<Wire>*>(data); }

  Generated generated_;
  Mutex key_mutex_;
};

}  // namespace cairn::wire
