#include "common/wire/rtps_datagram.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "common/wire/limits.h"

namespace cairn::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint8_t kLittleEndian = 0x01;
constexpr std::uint8_t kInlineQos = 0x02;
constexpr std::uint8_t kHasData = 0x04;

// Builds datagrams, little-endian.
class Datagram {
 public:
  Datagram() : bytes_{'R', 'T', 'P', 'S', 2, 3, 1, 15} {
    for (std::uint8_t i = 0; i < 12; ++i) bytes_.push_back(i);
  }
  Datagram& Begin(std::uint8_t id, std::uint8_t flags) {
    bytes_.insert(bytes_.end(), {id, static_cast<std::uint8_t>(flags | kLittleEndian), 0, 0});
    start_ = bytes_.size();
    return *this;
  }
  Datagram& U16(std::uint16_t v) { return Put(v, 2); }
  Datagram& U32(std::uint32_t v) { return Put(v, 4); }
  Datagram& Sequence(std::int64_t v) {
    return U32(static_cast<std::uint32_t>(static_cast<std::uint64_t>(v) >> 32)).U32(static_cast<std::uint32_t>(v));
  }
  Datagram& Zeros(std::size_t n) {
    bytes_.resize(bytes_.size() + n);
    return *this;
  }
  // Sets the submessage's length to what was put in since Begin.
  Datagram& End() { return EndWithLength(static_cast<std::uint16_t>(bytes_.size() - start_)); }
  Datagram& EndWithLength(std::uint16_t length) {
    bytes_[start_ - 2] = static_cast<std::uint8_t>(length);
    bytes_[start_ - 1] = static_cast<std::uint8_t>(length >> 8);
    return *this;
  }
  Datagram& Heartbeat(std::int64_t first, std::int64_t last) {
    return Begin(0x07, 0).U32(0).U32(0x000002c2).Sequence(first).Sequence(last).U32(1).End();
  }
  [[nodiscard]] DatagramFault Inspect() const {
    SequenceGate gate;
    return InspectDatagram(bytes_, gate);
  }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }

 private:
  Datagram& Put(std::uint32_t v, int n) {
    for (int i = 0; i < n; ++i) bytes_.push_back(static_cast<std::uint8_t>(v >> (8 * i)));
    return *this;
  }
  Bytes bytes_;
  std::size_t start_ = 0;
};

Datagram Data(std::uint8_t flags, std::int64_t sequence) {
  Datagram datagram;
  datagram.Begin(0x15, flags).U16(0).U16(16).U32(0).U32(0x02000000).Sequence(sequence);
  return datagram;
}

Datagram DataFrag(std::uint32_t start, std::uint16_t count, std::uint16_t size, std::uint32_t total) {
  Datagram datagram;
  datagram.Begin(0x16, 0).U16(0).U16(28).U32(0).U32(0x02000000).Sequence(1).U32(start).U16(count).U16(size).U32(total);
  return datagram;
}

TEST(RtpsDatagram, WhatIsNotRtpsIsRefused) {
  SequenceGate gate;
  EXPECT_EQ(InspectDatagram({}, gate), DatagramFault::kNotRtps);
  EXPECT_EQ(InspectDatagram(Bytes(19, 'R'), gate), DatagramFault::kNotRtps);
  Bytes other = Datagram().bytes();
  other[3] = 'X';
  EXPECT_EQ(InspectDatagram(other, gate), DatagramFault::kNotRtps);
  EXPECT_EQ(Datagram().Inspect(), DatagramFault::kNone);
}

// The 84 bytes that abort Fast DDS 2.9.1: a statistics submessage of the right length that is not the last.
TEST(RtpsDatagram, TheStatisticsAssertIsNotReached) {
  const Datagram alone = Datagram().Begin(0x80, 0).Zeros(56).End();
  EXPECT_EQ(alone.Inspect(), DatagramFault::kNone);
  const Datagram followed = Datagram().Begin(0x80, 0).Zeros(56).End().Begin(0x01, 0).End();
  EXPECT_EQ(followed.bytes().size(), 84U);
  EXPECT_EQ(followed.Inspect(), DatagramFault::kStatistics);
}

TEST(RtpsDatagram, SubmessagesLongerThanTheDatagramAreRefused) {
  EXPECT_EQ(Datagram().Begin(0x55, 0).Zeros(4).EndWithLength(5).Inspect(), DatagramFault::kFraming);
  Bytes cut = Datagram().Heartbeat(1, 2).bytes();
  SequenceGate gate;
  for (std::size_t size = 21; size < cut.size(); ++size) {
    EXPECT_NE(InspectDatagram(std::span(cut).first(size), gate), DatagramFault::kNone) << size;
  }
}

TEST(RtpsDatagram, UnknownSubmessagesPass) {
  EXPECT_EQ(Datagram().Begin(0x55, 0).Zeros(8).End().Heartbeat(1, 2).Inspect(), DatagramFault::kNone);
}

TEST(RtpsDatagram, HeartbeatsWithAbsurdNumbersAreRefused) {
  EXPECT_EQ(Datagram().Heartbeat(1, 0).Inspect(), DatagramFault::kNone);
  EXPECT_EQ(Datagram().Heartbeat(5, 3).Inspect(), DatagramFault::kSequence);
  EXPECT_EQ(Datagram().Heartbeat(-1, 3).Inspect(), DatagramFault::kSequence);
  EXPECT_EQ(Datagram().Heartbeat(1, std::int64_t{1} << 62).Inspect(), DatagramFault::kSequence);
}

TEST(RtpsDatagram, ALongUptimeIsNotAJump) {
  SequenceGate gate;
  const std::int64_t years = std::int64_t{1} << 38;
  EXPECT_EQ(InspectDatagram(Datagram().Heartbeat(years, years).bytes(), gate), DatagramFault::kNone);
  const std::int64_t next = years + SequenceGate::kMaxJump;
  EXPECT_EQ(InspectDatagram(Datagram().Heartbeat(next, next).bytes(), gate), DatagramFault::kNone);
  const std::int64_t jump = next + SequenceGate::kMaxJump + 1;
  EXPECT_EQ(InspectDatagram(Datagram().Heartbeat(jump, jump).bytes(), gate), DatagramFault::kSequence);
}

TEST(RtpsDatagram, GapsTheLibraryWouldWalkForMinutesAreRefused) {
  const auto gap = [](std::int64_t start, std::int64_t base, std::uint32_t bits, std::size_t words) {
    return Datagram().Begin(0x08, 0).U32(0).U32(0).Sequence(start).Sequence(base).U32(bits).Zeros(4 * words).End();
  };
  EXPECT_EQ(gap(1, 100, 256, 8).Inspect(), DatagramFault::kNone);
  EXPECT_EQ(gap(1, 2 + SequenceGate::kMaxJump, 0, 0).Inspect(), DatagramFault::kSequence);
  EXPECT_EQ(gap(0, 1, 0, 0).Inspect(), DatagramFault::kSequence);
  EXPECT_EQ(gap(5, 4, 0, 0).Inspect(), DatagramFault::kSequence);
  EXPECT_EQ(gap(1, 100, 257, 9).Inspect(), DatagramFault::kSequenceSet);
  EXPECT_EQ(gap(1, 100, 64, 1).Inspect(), DatagramFault::kSequenceSet);
}

TEST(RtpsDatagram, AcknowledgementsMustHoldTheirBits) {
  const auto ack = [](std::int64_t base, std::uint32_t bits, std::size_t words) {
    return Datagram().Begin(0x06, 0).U32(0).U32(0).Sequence(base).U32(bits).Zeros(4 * words).U32(1).End();
  };
  EXPECT_EQ(ack(1, 33, 2).Inspect(), DatagramFault::kNone);
  EXPECT_EQ(ack(1, 33, 1).Inspect(), DatagramFault::kSequenceSet);
  EXPECT_EQ(ack(1, 0xffffffffU, 1).Inspect(), DatagramFault::kSequenceSet);
  EXPECT_EQ(ack(-1, 0, 0).Inspect(), DatagramFault::kSequence);
}

TEST(RtpsDatagram, InlineParametersMustEndInsideTheirList) {
  EXPECT_EQ(Data(kInlineQos, 1).U16(0x70).U16(16).Zeros(16).U16(1).U16(0).End().Inspect(), DatagramFault::kNone);
  EXPECT_EQ(Data(kInlineQos, 1).U16(0x70).U16(8).Zeros(8).U16(1).U16(0).End().Inspect(), DatagramFault::kParameterList);
  EXPECT_EQ(Data(kInlineQos, 1).U16(0x99).U16(400).Zeros(8).U16(1).U16(0).End().Inspect(),
            DatagramFault::kParameterList);
  EXPECT_EQ(Data(kInlineQos, 1).U16(0x99).U16(4).Zeros(4).End().Inspect(), DatagramFault::kParameterList);
}

TEST(RtpsDatagram, DataNeedsItsEncapsulation) {
  EXPECT_EQ(Data(kHasData, 1).Zeros(4).End().Inspect(), DatagramFault::kNone);
  EXPECT_EQ(Data(kHasData, 1).Zeros(3).End().Inspect(), DatagramFault::kFraming);
}

TEST(RtpsDatagram, DiscoveryDataMustBeAWholeParameterList) {
  const auto discovery = [](std::uint32_t writer) {
    Datagram datagram;
    return datagram.Begin(0x15, kHasData).U16(0).U16(16).U32(0).U32(writer).Sequence(1).U16(0x0300).U16(0);
  };
  constexpr std::uint32_t kPublications = 0xc2030000;
  EXPECT_EQ(discovery(kPublications).U16(5).U16(4).Zeros(4).U16(1).U16(0).End().Inspect(), DatagramFault::kNone);
  EXPECT_EQ(discovery(kPublications).U16(5).U16(400).Zeros(4).End().Inspect(), DatagramFault::kParameterList);
  EXPECT_EQ(discovery(kPublications).U16(5).U16(4).Zeros(4).End().Inspect(), DatagramFault::kParameterList);
  // Fast DDS marks its liveliness messages as a list, which they are not: refusing them ended every lease.
  constexpr std::uint32_t kLiveliness = 0xc2000200;
  EXPECT_EQ(discovery(kLiveliness).Zeros(24).End().Inspect(), DatagramFault::kNone);
}

TEST(RtpsDatagram, FragmentsMustDescribeASampleWithinTheLimit) {
  EXPECT_EQ(DataFrag(1, 1, 1000, 1500).Zeros(1000).End().Inspect(), DatagramFault::kNone);
  EXPECT_EQ(DataFrag(2, 1, 1000, 1500).Zeros(500).End().Inspect(), DatagramFault::kNone);
  EXPECT_EQ(DataFrag(3, 1, 1000, 1500).Zeros(500).End().Inspect(), DatagramFault::kFragment);
  EXPECT_EQ(DataFrag(0, 1, 1000, 1500).Zeros(1000).End().Inspect(), DatagramFault::kFragment);
  EXPECT_EQ(DataFrag(1, 0, 1000, 1500).Zeros(1000).End().Inspect(), DatagramFault::kFragment);
  EXPECT_EQ(DataFrag(1, 1, 0, 1500).Zeros(1000).End().Inspect(), DatagramFault::kFragment);
  EXPECT_EQ(DataFrag(1, 1, 1000, 1500).Zeros(999).End().Inspect(), DatagramFault::kFragment);
  EXPECT_EQ(DataFrag(1, 1, 1000, 0xffffffffU).Zeros(1000).End().Inspect(), DatagramFault::kFragment);
  EXPECT_EQ(DataFrag(1, 1, 1000, kMaxSampleBytes + 1).Zeros(1000).End().Inspect(), DatagramFault::kFragment);
}

TEST(RtpsDatagram, RandomSubmessagesAreInspectedWithoutReadingBeyondThem) {
  std::mt19937 random(7);
  SequenceGate gate;
  for (int round = 0; round < 100000; ++round) {
    Bytes bytes = Datagram().bytes();
    for (unsigned i = 0, n = random() % 100; i < n; ++i) bytes.push_back(static_cast<std::uint8_t>(random()));
    if (bytes.size() > 24) {
      bytes[20] = static_cast<std::uint8_t>(random() % 0x18);
      bytes[22] = static_cast<std::uint8_t>(bytes.size() - 24);
      bytes[23] = 0;
    }
    // Exactly sized, so that the address sanitizer sees the first byte read beyond.
    const Bytes exact(bytes.begin(), bytes.end());
    static_cast<void>(InspectDatagram(exact, gate));
  }
}

}  // namespace
}  // namespace cairn::wire
