#include "common/wire/rtps_datagram.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <vector>

#include "common/wire/limits.h"
#include "tests/common/wire/datagram.h"

namespace cairn::wire {
namespace {

using namespace test;

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

// Fast DDS adds statistics to each datagram, also where its receivers cut them off.
TEST(RtpsDatagram, StatisticsAtTheEndAreLeftOut) {
  const Bytes plain = Datagram().Heartbeat(1, 2).bytes();
  const auto left = [](const Bytes& datagram) {
    const auto kept = WithoutStatistics(datagram);
    return Bytes(kept.begin(), kept.end());
  };
  EXPECT_EQ(left(plain), plain);
  Bytes with = Datagram().Heartbeat(1, 2).Begin(0x80, 0).Zeros(56).End().bytes();
  ASSERT_EQ(with.size(), plain.size() + 60);
  for (; with.size() >= plain.size() + 4; with.pop_back()) EXPECT_EQ(left(with), plain) << with.size();
  const Bytes to_the_end = Datagram().Heartbeat(1, 2).Begin(0x80, 0).Zeros(56).EndWithLength(0).bytes();
  EXPECT_EQ(left(to_the_end), plain);
  const Bytes followed = Datagram().Begin(0x80, 0).Zeros(56).End().Heartbeat(1, 2).bytes();
  EXPECT_EQ(left(followed), followed);
  for (std::size_t size = 0; size <= plain.size(); ++size) {
    const Bytes cut(plain.begin(), plain.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_EQ(left(cut), cut);
  }
}

// It aborts Fast DDS 2.9.1, which goes on at the next multiple of four bytes, with an empty submessage and then with
// statistics that are not the last. Without the gap there is one unknown submessage to the end.
TEST(RtpsDatagram, TheNextSubmessageBeginsAtTheSamePlaceForEveryReceiver) {
  Datagram two_readings = Datagram().Begin(0x00, 0).Zeros(7).EndWithLength(7);
  two_readings.U16(0x0122).U16(0).Zeros(1).Begin(0x80, 0).Zeros(56).End().Zeros(8);
  EXPECT_EQ(two_readings.Inspect(), DatagramFault::kFraming);
  EXPECT_EQ(Datagram().Begin(0x55, 0).Zeros(7).End().Inspect(), DatagramFault::kNone);
  for (const std::size_t length : {4U, 8U})
    EXPECT_EQ(Datagram().Begin(0x55, 0).Zeros(length).End().Heartbeat(1, 2).Inspect(), DatagramFault::kNone) << length;
  for (const std::size_t length : {1U, 2U, 3U, 5U, 6U, 7U})
    EXPECT_EQ(Datagram().Begin(0x55, 0).Zeros(length).End().Heartbeat(1, 2).Inspect(), DatagramFault::kFraming)
        << length;
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

// The numbers of one writer or reader, and a clock that stands still unless it is told.
class Numbers {
 public:
  DatagramFault Take(const Datagram& datagram) { return InspectDatagram(datagram.bytes(), gate_, now_); }
  void Pass(std::chrono::milliseconds time) { now_ += time; }
  SequenceGate& gate() { return gate_; }

 private:
  SequenceGate gate_;
  SequenceGate::Clock::time_point now_{std::chrono::hours(1)};
};

// Takes the heartbeats of a writer that repeats its number until one is accepted, at most so many; returns how many.
int RepeatUntilAccepted(Numbers& numbers, std::int64_t number, int at_most) {
  int heartbeats = 1;
  while (numbers.Take(Datagram().Heartbeat(number, number)) != DatagramFault::kNone && heartbeats < at_most) {
    numbers.Pass(std::chrono::milliseconds(100));
    ++heartbeats;
  }
  return heartbeats;
}

TEST(RtpsDatagram, ALongUptimeIsNotAJump) {
  Numbers numbers;
  const std::int64_t years = std::int64_t{1} << 38;
  EXPECT_EQ(RepeatUntilAccepted(numbers, years, 10), SequenceGate::kRepetitions);
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(years, years + 1)), DatagramFault::kNone);
  Numbers young;
  EXPECT_EQ(RepeatUntilAccepted(young, SequenceGate::kAtOnce, 10), 1);
}

// The library counted from 0 to the number of one mutated heartbeat, the first that the guard saw of its writer: for
// days, while nothing else arrived.
TEST(RtpsDatagram, AForgedFirstNumberIsNotBelievedUntilItIsRepeated) {
  Numbers numbers;
  const std::int64_t absurd = std::int64_t{1} << 39;
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(numbers.Take(Datagram().Heartbeat(absurd + i * 100000, absurd + i * 100000)), DatagramFault::kSequence);
    numbers.Pass(std::chrono::milliseconds(100));
  }
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(1, 40)), DatagramFault::kNone) << "the writer's own";
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(absurd, absurd)), DatagramFault::kSequence);
  // Copies of one datagram come at once.
  Numbers copies;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(copies.Take(Datagram().Heartbeat(absurd, absurd)), DatagramFault::kSequence);
}

// A heartbeat or a gap of a few thousand numbers stopped a stream of 10 Hz for minutes.
TEST(RtpsDatagram, ForgedNumbersThatRunAheadAreRefused) {
  Numbers numbers;
  const auto gap = [](std::int64_t start, std::int64_t base) {
    return Datagram().Begin(0x08, 0).U32(0).U32(0x000002c2).Sequence(start).Sequence(base).U32(0).End();
  };
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(1, 100)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(3000, 3000)), DatagramFault::kSequence);
  EXPECT_EQ(numbers.Take(gap(101, 3000)), DatagramFault::kSequence);
  EXPECT_EQ(numbers.Take(gap(101, 103)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(1, 104)), DatagramFault::kNone);
}

TEST(RtpsDatagram, ASetOfTheGapBeyondThePlausibleIsRefused) {
  Numbers numbers;
  const auto gap = [](std::int64_t base) {
    return Datagram().Begin(0x08, 0).U32(0).U32(0).Sequence(1).Sequence(base).U32(256).Zeros(28).U32(1).End();
  };
  EXPECT_EQ(numbers.Take(gap(1)), DatagramFault::kNone);  // The last bit: 256 is the highest known.
  EXPECT_EQ(numbers.Take(gap(257 + SequenceGate::kStep)), DatagramFault::kSequence);
}

TEST(RtpsDatagram, WhatIsLostIsSkippedAndSilenceAllowsMore) {
  Numbers numbers;
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(1, 1)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(1, 2 + SequenceGate::kStep)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(1, 12 + SequenceGate::kStep)), DatagramFault::kSequence);
  numbers.Pass(std::chrono::hours(8));
  const std::int64_t all_night = SequenceGate::kRate * 8 * 3600;
  EXPECT_EQ(RepeatUntilAccepted(numbers, all_night, 10), SequenceGate::kRepetitions);
}

TEST(RtpsDatagram, AnyNumberOfSamplesInSuccessionPass) {
  Numbers numbers;
  for (int i = 1; i <= 100000; ++i) ASSERT_EQ(numbers.Take(Data(0, i).End()), DatagramFault::kNone) << i;
}

// The library ignores every later heartbeat or acknowledgement whose own count is lower.
TEST(RtpsDatagram, CountsAreReplacedSoThatForgedOnesDoNoHarm) {
  SequenceGate gate;
  const auto both = [](std::uint32_t heartbeats, std::uint32_t acknowledgements, std::uint32_t requests) {
    Datagram datagram;
    datagram.Begin(0x07, 0).U32(0).U32(0x000002c2).Sequence(1).Sequence(2).U32(heartbeats).End();
    datagram.Begin(0x06, 0).U32(7).U32(0x000002c2).Sequence(1).U32(33).U32(0).U32(0).U32(acknowledgements).End();
    datagram.Begin(0x12, 0).U32(7).U32(0x000002c2).Sequence(1).U32(1).U32(1).U32(0).U32(requests).End();
    return datagram.bytes();
  };
  EXPECT_EQ(WithOwnCounts(both(7, 7, 7), gate), both(1, 2, 3)) << "who is new begins above all counts";
  EXPECT_EQ(WithOwnCounts(both(0x7fffffff, 0xffffffff, 0x7fffffff), gate), both(2, 3, 4));
  EXPECT_EQ(WithOwnCounts(both(8, 8, 8), gate), both(3, 4, 5));
  const auto big_endian = [](std::uint32_t count) {
    Bytes bytes = Datagram().bytes();
    bytes.insert(bytes.end(), {0x07, 0, 0, 28, 0, 0, 0, 0, 0, 0, 2, 3});
    bytes.insert(bytes.end(), {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 2});
    bytes.insert(bytes.end(), {0, 0, 0, static_cast<std::uint8_t>(count)});
    return bytes;
  };
  EXPECT_EQ(WithOwnCounts(big_endian(99), gate), big_endian(6));
  EXPECT_TRUE(WithOwnCounts(Data(kHasData, 1).Zeros(4).End().bytes(), gate).empty()) << "there is nothing to change";
}

TEST(RtpsDatagram, WhatDdsSecurityHasSignedIsNotChanged) {
  SequenceGate gate;
  Datagram datagram;
  datagram.Begin(0x33, 0).U32(0).U32(0).End();
  datagram.Heartbeat(1, 2);
  EXPECT_TRUE(WithOwnCounts(datagram.bytes(), gate).empty());
}

TEST(RtpsDatagram, CountsGrowAlsoWhereTooManyPeersCount) {
  SequenceGate gate;
  SequenceGate::Key peer{};
  EXPECT_EQ(gate.NextCount(peer), 1U);
  EXPECT_EQ(gate.NextCount(peer), 2U);
  for (std::uint32_t other = 1; other <= SequenceGate::kMaxPeers; ++other) {
    std::memcpy(peer.data(), &other, sizeof(other));
    static_cast<void>(gate.NextCount(peer));
  }
  EXPECT_GT(gate.NextCount({}), 2U);
}

TEST(RtpsDatagram, AcknowledgementsOfSamplesThatWereNeverSentAreRefused) {
  constexpr std::uint32_t kWriter = 0x000002c2;
  const auto ack = [](std::int64_t base, std::uint32_t bits, std::uint32_t word, std::uint32_t count) {
    return Datagram().Begin(0x06, 0).U32(7).U32(kWriter).Sequence(base).U32(bits).U32(word).U32(count).End();
  };
  Numbers numbers;
  EXPECT_EQ(numbers.Take(ack(500, 32, 0, 1)), DatagramFault::kNone);  // Nothing is known of what is sent.
  NoteSent(Datagram().Heartbeat(1, 10).bytes(), numbers.gate());
  EXPECT_EQ(numbers.Take(ack(11, 32, 0, 2)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(ack(12, 32, 0, 3)), DatagramFault::kUnsent);
  EXPECT_EQ(numbers.Take(ack(10, 32, 0x80000000, 3)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(ack(10, 32, 0x40000000, 4)), DatagramFault::kUnsent);
  EXPECT_EQ(numbers.Take(ack(11, 32, 0, 5)), DatagramFault::kNone);
}

TEST(RtpsDatagram, AcknowledgementsForOthersAreNotCompared) {
  Numbers numbers;
  NoteSent(Datagram().Heartbeat(1, 10).bytes(), numbers.gate());
  const Datagram other = Datagram().Begin(0x0e, 0).U32(9).U32(9).U32(9).End().Begin(0x06, 0).U32(7).U32(0x000002c2);
  EXPECT_EQ(numbers.Take(Datagram(other).Sequence(500).U32(0).U32(1).End()), DatagramFault::kNone);
}

TEST(RtpsDatagram, GapsTheLibraryWouldWalkForMinutesAreRefused) {
  const auto gap = [](std::int64_t start, std::int64_t base, std::uint32_t bits, std::size_t words) {
    return Datagram().Begin(0x08, 0).U32(0).U32(0).Sequence(start).Sequence(base).U32(bits).Zeros(4 * words).End();
  };
  EXPECT_EQ(gap(1, 100, 256, 8).Inspect(), DatagramFault::kNone);
  EXPECT_EQ(gap(1, 2 + kMaxGap, 0, 0).Inspect(), DatagramFault::kSequence);
  EXPECT_EQ(gap(1, 1 + kMaxGap, 0, 0).Inspect(), DatagramFault::kNone);
  EXPECT_EQ(gap(0, 1, 0, 0).Inspect(), DatagramFault::kSequence);
  EXPECT_EQ(gap(5, 4, 0, 0).Inspect(), DatagramFault::kSequence);
  EXPECT_EQ(gap(1, 100, 257, 9).Inspect(), DatagramFault::kSequenceSet);
  EXPECT_EQ(gap(1, 100, 64, 1).Inspect(), DatagramFault::kSequenceSet);
}

// Of a robot that has left, the last sample is kept for years, and the other robots go on.
TEST(RtpsDatagram, AGapMayLeaveOutEverythingThatItsWriterHasReached) {
  constexpr std::uint32_t kWriter = 0x000002c2;
  const auto gap = [](std::int64_t start, std::int64_t base) {
    return Datagram().Begin(0x08, 0).U32(7).U32(kWriter).Sequence(start).Sequence(base).U32(0).End();
  };
  Numbers numbers;
  const std::int64_t reached = 20 * kMaxGap;
  EXPECT_EQ(numbers.Take(gap(2, reached)), DatagramFault::kSequence);
  EXPECT_EQ(numbers.Take(Datagram().Heartbeat(1, reached)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(gap(2, reached)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(gap(2, reached + 1)), DatagramFault::kNone);
  EXPECT_EQ(numbers.Take(gap(2, reached + 2)), DatagramFault::kSequence);
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

// Built-in endpoints, the last byte of whose id begins with two bits, send no fragments. A key in fragments would be
// delivered as a sample that nobody has sent.
// Those of other built-in endpoints are assembled: Cyclone DDS sends the type of an endpoint in them, and was not
// served when they were refused.
TEST(RtpsDatagram, FragmentsOfHandshakesAndOfKeysAreRefused) {
  const auto fragment = [](std::uint8_t flags, std::uint32_t reader, std::uint32_t writer) {
    Datagram datagram;
    datagram.Begin(0x16, flags).U16(0).U16(28).U32(reader).U32(writer).Sequence(1).U32(1).U16(1).U16(8).U32(16);
    return datagram.Zeros(8).End().Inspect();
  };
  EXPECT_EQ(fragment(0, 0x07000000, 0x02000000), DatagramFault::kNone);
  EXPECT_EQ(fragment(0, 0xc7040000, 0xc2040000), DatagramFault::kNone);
  EXPECT_EQ(fragment(0, 0xc4010200, 0xc3010200), DatagramFault::kFragment);
  EXPECT_EQ(fragment(0x04, 0x07000000, 0x02000000), DatagramFault::kFragment);
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
