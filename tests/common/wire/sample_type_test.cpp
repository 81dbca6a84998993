#include "common/wire/sample_type.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <random>
#include <thread>

#include "common/wire/bounds.h"
#include "common/wire/convert.h"
#include "common/wire/topics.h"
#include "tests/common/wire/sample_values.h"

namespace cairn::wire {
namespace {

using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;
using Bytes = std::vector<std::uint8_t>;

template <typename Value>
Bytes Serialize(const Value& value) {
  typename Topic<Value>::Type type;
  Sample<typename Topic<Value>::Wire> sample;
  sample.value = ToWire(value);
  Payload payload(type.getSerializedSizeProvider(&sample)());
  EXPECT_TRUE(type.serialize(&sample, &payload));
  return {payload.data, payload.data + payload.length};
}

// Decodes as a reader would; asks for the key as the middleware would. Returns what the reader sees.
template <typename Value>
Decoding Decode(const Bytes& bytes, Value* value = nullptr, std::optional<ClientId> only = {}) {
  typename Topic<Value>::Type type;
  Sample<typename Topic<Value>::Wire> sample;
  sample.only = only;
  Payload payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  EXPECT_TRUE(type.deserialize(&payload, &sample));
  eprosima::fastrtps::rtps::InstanceHandle_t handle;
  EXPECT_EQ(type.getKey(&sample, &handle, false), type.m_isGetKeyDefined);
  if (sample.decoding == Decoding::kDecoded && CheckBounds(sample.value)) {
    auto decoded = FromWire(std::move(sample.value));
    if (value != nullptr) *value = std::move(decoded);
  }
  return sample.decoding;
}

template <typename Value>
class HostileCdr : public ::testing::Test {};

template <typename Value>
Value Extreme();
template <>
SessionRequest Extreme() {
  return ExtremeSessionRequest();
}
template <>
SessionState Extreme() {
  return ExtremeSessionState();
}
template <>
ScanSample Extreme() {
  return ExtremeScan(64);
}
template <>
OdometrySample Extreme() {
  return ExtremeOdometry();
}
template <>
PoseReport Extreme() {
  return ExtremePose();
}
template <>
Ledger Extreme() {
  return ExtremeLedger();
}
template <>
MapInfo Extreme() {
  return ExtremeMapInfo();
}
template <>
TileSample Extreme() {
  return ExtremeTile(100);
}
template <>
Job Extreme() {
  return ExtremeJob();
}
template <>
Request Extreme() {
  return ExtremeRequest();
}
template <>
Reply Extreme() {
  return ExtremeReply();
}

using Values = ::testing::Types<SessionRequest, SessionState, ScanSample, OdometrySample, PoseReport, Ledger, MapInfo,
                                TileSample, Job, Request, Reply>;
TYPED_TEST_SUITE(HostileCdr, Values);

TYPED_TEST(HostileCdr, TheUnharmedSampleDecodes) {
  TypeParam value;
  EXPECT_EQ(Decode<TypeParam>(Serialize(Extreme<TypeParam>()), &value), Decoding::kDecoded);
  EXPECT_TRUE(Same(value, Extreme<TypeParam>()));
}

TYPED_TEST(HostileCdr, TruncatedSamplesNeverThrow) {
  const Bytes whole = Serialize(Extreme<TypeParam>());
  const std::size_t stride = whole.size() > 4096 ? 37 : 1;
  for (std::size_t size = 0; size < whole.size(); size += stride) {
    const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    // Up to 3 bytes of padding may go unmissed.
    const Decoding decoding = Decode<TypeParam>(cut);
    if (size + 8 < whole.size()) {
      EXPECT_EQ(decoding, Decoding::kUndecodable) << size;
    }
  }
}

TYPED_TEST(HostileCdr, HugeLengthsAnywhereNeitherThrowNorAllocate) {
  const Bytes whole = Serialize(Extreme<TypeParam>());
  rusage before{};
  getrusage(RUSAGE_SELF, &before);
  const std::size_t stride = whole.size() > 4096 ? 52 : 4;
  for (const std::uint32_t length : {0xffffffffU, 0x7fffffffU, 500'000'000U, 0xfffffff0U}) {
    for (std::size_t at = 4; at + 4 <= whole.size(); at += stride) {
      Bytes bytes = whole;
      for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(length >> (8 * i));
      Decode<TypeParam>(bytes);
    }
  }
  rusage after{};
  getrusage(RUSAGE_SELF, &after);
  // In KiB: less than the smallest of these lengths. The address sanitizer alone keeps 256 MiB of what was freed.
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 400 * 1024);
}

TYPED_TEST(HostileCdr, RandomBytesAndMutationsNeverThrow) {
  std::mt19937 random(20260101);
  const Bytes whole = Serialize(Extreme<TypeParam>());
  for (int round = 0; round < 3000; ++round) {
    Bytes bytes;
    if (round % 3 == 0) {
      bytes.resize(random() % 600);
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    } else {
      bytes = whole;
      for (unsigned i = 0, n = 1 + random() % 8; i < n; ++i)
        bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    }
    Decode<TypeParam>(bytes);
  }
}

TYPED_TEST(HostileCdr, UnknownEncapsulationsAreUndecodable) {
  Bytes bytes = Serialize(Extreme<TypeParam>());
  bytes[1] = 0x7f;  // Uncaught, this ends the process.
  EXPECT_EQ(Decode<TypeParam>(bytes), Decoding::kUndecodable);
}

TEST(SampleType, OversizeSamplesAreUndecodable) {
  Bytes bytes = Serialize(ExtremeScan(64));
  bytes.resize(kMaxSampleBytes + 1);
  EXPECT_EQ(Decode<ScanSample>(bytes), Decoding::kUndecodable);
}

TEST(SampleType, SkipsRepliesToOtherClients) {
  const Bytes bytes = Serialize(ExtremeReply());
  EXPECT_EQ(Decode<Reply>(bytes, nullptr, ExtremeReply().client), Decoding::kDecoded);
  EXPECT_EQ(Decode<Reply>(bytes, nullptr, ClientId{1}), Decoding::kForeign);
}

TEST(SampleType, PeeksTheClientInBothByteOrders) {
  const std::uint8_t little[] = {0, 1, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1};
  const std::uint8_t big[] = {0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8};
  EXPECT_EQ(PeekFirstNumber(little, sizeof(little)), 0x0102030405060708U);
  EXPECT_EQ(PeekFirstNumber(big, sizeof(big)), 0x0102030405060708U);
  EXPECT_EQ(PeekFirstNumber(big, 11), std::nullopt);
}

TEST(SampleType, KeysOfTheTileFitTheHandleUnhashed) {
  Topic<TileSample>::Type type;
  Sample<v1::Tile> sample;
  sample.value.site_id(0x0102030405060708U);
  sample.value.x(-2);
  sample.value.y(3);
  sample.value.level(1);
  eprosima::fastrtps::rtps::InstanceHandle_t handle;
  ASSERT_TRUE(type.getKey(&sample, &handle, false));
  const std::uint8_t expected[] = {1, 2, 3, 4, 5, 6, 7, 8, 0xff, 0xfe, 0, 3, 1, 0, 0, 0};
  for (int i = 0; i < 16; ++i) EXPECT_EQ(handle.value[i], expected[i]) << i;
}

// Two threads on one generated type computed wrong keys: it keeps its buffer in the type object.
TEST(SampleType, KeysAreRightFromTwoThreads) {
  Topic<ScanSample>::Type type;
  std::atomic<int> wrong = 0;
  const auto compute = [&](std::uint8_t robot) {
    Sample<v1::Scan> sample;
    sample.value.robot_id(robot);
    for (int i = 0; i < 20000; ++i) {
      eprosima::fastrtps::rtps::InstanceHandle_t handle;
      if (!type.getKey(&sample, &handle, false) || handle.value[7] != robot) ++wrong;
    }
  };
  std::thread other(compute, std::uint8_t{1});
  compute(2);
  other.join();
  EXPECT_EQ(wrong, 0);
}

TEST(SampleType, AnnouncesNoTypeObjects) {
  const Topic<ScanSample>::Type type;
  EXPECT_FALSE(type.auto_fill_type_object());
  EXPECT_FALSE(type.auto_fill_type_information());
}

}  // namespace
}  // namespace cairn::wire
