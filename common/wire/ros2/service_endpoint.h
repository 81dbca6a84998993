// The endpoints of a service on the wire: the reader of requests and the writer of answers, in both conventions.
//
// - rmw_fastrtps: the request is a plain sample. Its identity (GUID of the writer and number of the sample) is the
//   request's; a newer client also names the reader of its answers, as "related sample identity" in the inline QoS. The
//   answer carries the identity of the request, with the GUID of that reader where it is named, as its own related one.
//   (rmw_fastrtps_shared_cpp: custom_service_info.hpp, rmw_request.cpp, rmw_response.cpp)
// - rmw_cyclonedds: in front of the message are 16 bytes, a 64-bit number of the client and one of the request, in the
//   byte order of the message. The answer has the same 16 bytes in front. (rmw_cyclonedds_cpp: serdata.cpp,
//   rmw_node.cpp)
//
// Names, types and QoS are the same in both, so one pair of endpoints serves both; which one a caller speaks is told by
// the vendor that its GUID begins with (RTPS 2.5, 9.3.1.5). This header uses the Fast DDS 2.x API; include it only
// inside common/wire and tests.
#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <array>
#include <exception>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <functional>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/status.h"
#include "common/wire/ros2/bus.h"
#include "common/wire/ros2/convert_services.h"
#include "common/wire/ros2/service_types.h"

namespace cairn::ros2 {

inline constexpr std::size_t kMaxRequestBytes = 4096;  // Requests have one name at most.

// Whether a GUID is of Cyclone DDS, whose rmw has the identity of a request in the message.
[[nodiscard]] inline bool IsOfCyclone(const WriterId& id) {
  constexpr std::array<std::uint8_t, 2> kEclipse{0x01, 0x10};
  return id[0] == kEclipse[0] && id[1] == kEclipse[1];
}

// A request as it came, because how it is decoded depends on who has sent it. Empty if it was too long.
struct RequestBytes {
  std::vector<char> bytes;
};

// What reads requests of the service S.
template <typename S>
class RequestType final : public eprosima::fastdds::dds::TopicDataType {
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;

 public:
  RequestType() {
    setName(typename ServiceType<S>::RequestType().getName());
    m_typeSize = kMaxRequestBytes;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* /*data*/, Payload* /*payload*/) override { return false; }
  bool deserialize(Payload* payload, void* data) override {
    auto& bytes = static_cast<RequestBytes*>(data)->bytes;
    bytes.clear();
    if (payload->length > kMaxRequestBytes) return true;
    try {
      bytes.assign(payload->data, payload->data + payload->length);
    } catch (const std::exception&) {
      bytes.clear();
    }
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* /*data*/) override {
    return [] { return std::uint32_t{0}; };
  }
  void* createData() override { return new RequestBytes(); }
  void deleteData(void* data) override { delete static_cast<RequestBytes*>(data); }
  bool getKey(void* /*data*/, eprosima::fastrtps::rtps::InstanceHandle_t* /*handle*/, bool /*force_md5*/) override {
    return false;
  }
};

// The request in these bytes. `caller`: who sent it; where the identity of the request is in the message, it is filled
// in here.
template <typename S>
[[nodiscard]] Result<typename S::Request> DecodeRequest(std::vector<char>& bytes, Caller& caller) {
  try {
    eprosima::fastcdr::FastBuffer buffer(bytes.data(), bytes.size());
    eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
    cdr.read_encapsulation();
    if (caller.in_message) cdr >> caller.client >> caller.sequence;
    // ROS has one byte in a message without fields, which means nothing.
    if constexpr (std::is_empty_v<typename S::Request>) {
      return typename S::Request{};
    } else {
      typename ServiceType<S>::RequestWire wire;
      wire.deserialize(cdr);
      return FromWire(std::move(wire));
    }
  } catch (const std::exception&) {
    return Fail(StatusCode::kDataLoss, "not decoded");
  }
}

// An answer, with what stands in front of it.
template <typename S>
struct AnswerSample {
  std::optional<Caller> in_front;
  typename ServiceType<S>::ResponseWire value;
};

// What writes answers of the service S.
template <typename S>
class AnswerType final : public eprosima::fastdds::dds::TopicDataType {
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;

 public:
  AnswerType() {
    setName(generated_.getName());
    m_typeSize = generated_.m_typeSize + kInFront;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, Payload* payload) override {
    const AnswerSample<S>& sample = Of(data);
    try {
      eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
      eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
      payload->encapsulation = cdr.endianness() == eprosima::fastcdr::Cdr::BIG_ENDIANNESS ? CDR_BE : CDR_LE;
      cdr.serialize_encapsulation();
      if (sample.in_front) cdr << sample.in_front->client << sample.in_front->sequence;
      sample.value.serialize(cdr);
      payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
      return true;
    } catch (const std::exception&) {
      return false;
    }
  }
  bool deserialize(Payload* /*payload*/, void* /*data*/) override { return false; }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [size = generated_.getSerializedSizeProvider(&Of(data).value)] { return size() + kInFront; };
  }
  void* createData() override { return new AnswerSample<S>(); }
  void deleteData(void* data) override { delete &Of(data); }
  bool getKey(void* /*data*/, eprosima::fastrtps::rtps::InstanceHandle_t* /*handle*/, bool /*force_md5*/) override {
    return false;
  }

 private:
  static constexpr std::uint32_t kInFront = 16;
  static AnswerSample<S>& Of(void* data) { return *static_cast<AnswerSample<S>*>(data); }

  typename ServiceType<S>::ResponseType generated_;
};

}  // namespace cairn::ros2
