// Values as the serialised samples in which they travel, and back as a reader decodes them.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "common/wire/bounds.h"
#include "common/wire/convert.h"
#include "common/wire/topics.h"
#include "tests/fuzz/fuzz_target.h"

namespace cairn::fuzz {

template <typename Value>
std::string Serialized(const Value& value) {
  typename wire::Topic<Value>::Type type;
  wire::Sample<typename wire::Topic<Value>::Wire> sample;
  sample.value = wire::ToWire(value);
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&sample)());
  Must(type.serialize(&sample, &payload), "a value can be serialised");
  return {reinterpret_cast<const char*>(payload.data), payload.length};
}

// What DdsSubscription does with a sample: nothing where it would count it as refused.
template <typename Value>
std::optional<Value> Received(std::string_view bytes) {
  typename wire::Topic<Value>::Type type;
  wire::Sample<typename wire::Topic<Value>::Wire> sample;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  Must(type.deserialize(&payload, &sample), "no sample is refused by the middleware");
  eprosima::fastrtps::rtps::InstanceHandle_t handle;
  Must(type.getKey(&sample, &handle, false) == type.m_isGetKeyDefined, "every sample has its key");
  if (sample.decoding != wire::Decoding::kDecoded || !wire::CheckBounds(sample.value)) return std::nullopt;
  return wire::FromWire(std::move(sample.value));
}

}  // namespace cairn::fuzz
