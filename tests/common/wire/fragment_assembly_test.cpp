#include "common/wire/fragment_assembly.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/common/wire/datagram.h"

namespace cairn::wire {
namespace {

using test::Bytes;
using test::Datagram;

constexpr std::uint8_t kWriterKind = 0x02;

// The byte of a sample's content at `at`.
std::uint8_t Content(std::size_t at) {
  return static_cast<std::uint8_t>(at * 7 + at / 256);
}

struct Part {
  std::int64_t sequence = 1;
  std::uint32_t first = 1;
  std::uint16_t count = 1;
  std::uint16_t fragment_bytes = 400;
  std::uint32_t sample_bytes = 1000;  // Three fragments.
};

void Put(Datagram& datagram, const Part& part) {
  datagram.Begin(kDataFrag, test::kInlineQos)
      .U16(0)
      .U16(28)
      .U32(0x07000000 | kWriterKind)
      .U32(0x02000000 | kWriterKind);
  datagram.Sequence(part.sequence).U32(part.first).U16(part.count).U16(part.fragment_bytes).U32(part.sample_bytes);
  datagram.U16(0x70).U16(16).U32(5).U32(6).U32(7).U32(8).U32(1);  // The key, as inline QoS.
  const std::size_t begin = (part.first - 1) * std::size_t{part.fragment_bytes};
  const std::size_t end = std::min<std::size_t>(part.sample_bytes, begin + part.count * part.fragment_bytes);
  for (std::size_t at = begin; at < end; ++at) datagram.Byte(Content(at));
  datagram.End();
}

Datagram Of(std::initializer_list<Part> parts) {
  Datagram datagram;
  for (const Part& part : parts) Put(datagram, part);
  return datagram;
}

// What the middleware should get instead.
Datagram Whole(const Part& part) {
  Datagram datagram;
  datagram.Begin(kData, test::kInlineQos | test::kHasData).U16(0).U16(16);
  datagram.U32(0x07000000 | kWriterKind).U32(0x02000000 | kWriterKind).Sequence(part.sequence);
  datagram.U16(0x70).U16(16).U32(5).U32(6).U32(7).U32(8).U32(1);
  for (std::size_t at = 0; at < part.sample_bytes; ++at) datagram.Byte(Content(at));
  return datagram.EndWithLength(0);
}

std::vector<Bytes> Only(const Bytes& datagram) {
  return std::vector<Bytes>(1, datagram);
}

class FragmentAssemblyTest : public ::testing::Test {
 protected:
  std::vector<Bytes> Take(const Datagram& datagram) {
    EXPECT_EQ(datagram.Inspect(), DatagramFault::kNone);
    EXPECT_TRUE(HasFragments(datagram.bytes()));
    return assembly_.Take(datagram.bytes());
  }
  FragmentAssembly assembly_;
};

TEST_F(FragmentAssemblyTest, ASampleIsDeliveredAsOneWhenItIsWhole) {
  EXPECT_TRUE(Take(Of({{.first = 3}})).empty());
  EXPECT_TRUE(Take(Of({{.first = 1}})).empty());
  const std::size_t waiting = assembly_.bytes();
  EXPECT_TRUE(Take(Of({{.first = 1}})).empty());
  EXPECT_EQ(assembly_.bytes(), waiting) << "what has arrived before takes no memory again";
  EXPECT_TRUE(Take(Of({{.sequence = 2, .first = 2}})).empty());  // Of another sample.
  const std::vector<Bytes> delivered = Take(Of({{.first = 2}}));
  EXPECT_EQ(delivered, Only(Whole({}).bytes()));
  EXPECT_EQ(Whole({}).Inspect(), DatagramFault::kNone);
  EXPECT_EQ(Take(Of({{.sequence = 2, .first = 1}, {.sequence = 2, .first = 3}})), Only(Whole({.sequence = 2}).bytes()));
  EXPECT_EQ(assembly_.bytes(), 0U);
}

TEST_F(FragmentAssemblyTest, ASampleMayBeLongerThanASubmessageCanSay) {
  const Part all{.count = 100, .fragment_bytes = 600, .sample_bytes = 200000};
  EXPECT_TRUE(Take(Of({all})).empty());
  Part next = all;
  next.first = 101;
  EXPECT_TRUE(Take(Of({next})).empty());
  next.first = 201;
  EXPECT_TRUE(Take(Of({next})).empty());
  next.first = 301;
  next.count = 34;
  EXPECT_EQ(Take(Of({next})), Only(Whole(all).bytes()));
}

// The sender, the receiver and the time that were said before the first fragment are said of the sample.
TEST_F(FragmentAssemblyTest, WhatIsSaidOfTheFirstFragmentIsSaidOfTheSample) {
  const auto about = [](Datagram& datagram) {
    datagram.Begin(kInfoDestination, 0).U32(1).U32(2).U32(3).End();
    datagram.Begin(kInfoTimestamp, 0).U32(4).U32(5).End();
  };
  Datagram first, last, expected;
  about(first);
  Put(first, {.count = 2});
  last.Begin(kInfoDestination, 0).U32(1).U32(2).U32(3).End();
  Put(last, {.first = 3});
  about(expected);
  Bytes whole = expected.bytes();
  const Bytes plain = Whole({}).bytes();
  whole.insert(whole.end(), plain.begin() + kRtpsHeaderBytes, plain.end());
  EXPECT_TRUE(Take(first).empty());
  EXPECT_EQ(Take(last), Only(whole));
}

// To the middleware they would not be parts of one sample.
TEST_F(FragmentAssemblyTest, FragmentsForDifferentReceiversAreDifferentSamples) {
  Datagram elsewhere;
  elsewhere.Begin(kInfoDestination, 0).U32(9).U32(9).U32(9).End();
  Put(elsewhere, {.first = 2, .count = 2});
  EXPECT_TRUE(Take(Of({{.first = 1}})).empty());
  EXPECT_TRUE(Take(elsewhere).empty());
  EXPECT_EQ(Take(Of({{.first = 2, .count = 2}})), Only(Whole({}).bytes()));
}

TEST_F(FragmentAssemblyTest, OtherSubmessagesDoNotWait) {
  Datagram mixed, others;
  mixed.Heartbeat(1, 2);
  Put(mixed, {});
  mixed.Begin(kGap, 0).U32(0).U32(0x02000000).Sequence(1).Sequence(2).U32(0).End();
  others.Heartbeat(1, 2);
  others.Begin(kGap, 0).U32(0).U32(0x02000000).Sequence(1).Sequence(2).U32(0).End();
  EXPECT_EQ(Take(mixed), Only(others.bytes()));
  // A sample that becomes whole comes before what its datagram says else.
  Datagram rest = Of({{.first = 2, .count = 2}});
  rest.Heartbeat(1, 2);
  EXPECT_EQ(Take(rest), (std::vector<Bytes>{Whole({}).bytes(), Datagram().Heartbeat(1, 2).bytes()}));
}

TEST_F(FragmentAssemblyTest, FragmentsOfAnotherSizeBeginAnotherSample) {
  EXPECT_TRUE(Take(Of({{.count = 2}})).empty());
  EXPECT_TRUE(Take(Of({{.count = 1, .fragment_bytes = 500}})).empty());
  EXPECT_TRUE(Take(Of({{.first = 3}})).empty());
  EXPECT_EQ(Take(Of({{.count = 2}})), Only(Whole({}).bytes()));
}

// As the middleware asks the writer of Put for the samples 1 and 3.
Datagram AckNack() {
  Datagram datagram;
  datagram.Begin(kInfoDestination, 0).U32(0x03020100).U32(0x07060504).U32(0x0b0a0908).End();
  datagram.Begin(kAckNack, 0).U32(0x07000000 | kWriterKind).U32(0x02000000 | kWriterKind);
  datagram.Sequence(1).U32(3).U32(0xa0000000).U32(9).End();
  return datagram;
}

// The datagrams of Put have no receiver, but the endpoint ids of the fragments' reader and writer.
TEST_F(FragmentAssemblyTest, AsksForTheFragmentsThatAreMissing) {
  EXPECT_TRUE(assembly_.WithQuestions(AckNack().bytes()).empty());
  EXPECT_TRUE(Take(Of({{.sequence = 1, .first = 1}, {.sequence = 2, .first = 1}})).empty());
  EXPECT_TRUE(Take(Of({{.sequence = 3, .first = 1, .fragment_bytes = 10}})).empty());
  const auto question = [](Datagram& datagram, std::int64_t sequence, std::uint32_t bits) -> Datagram& {
    datagram.Begin(kInfoDestination, 0).U32(0x03020100).U32(0x07060504).U32(0x0b0a0908).End();
    datagram.Begin(kNackFrag, 0).U32(0x07000000 | kWriterKind).U32(0x02000000 | kWriterKind);
    return datagram.Sequence(sequence).U32(2).U32(bits);
  };
  Datagram expected;
  question(expected, 1, 2).U32(0xc0000000).U32(1).End();
  question(expected, 3, 99).U32(0xffffffff).U32(0xffffffff).U32(0xffffffff).U32(0xe0000000).U32(2).End();
  expected.Begin(kInfoDestination, 0).U32(0).U32(0).U32(0).End();
  Bytes bytes = expected.bytes();
  const Bytes ack_nack = AckNack().bytes();
  bytes.insert(bytes.end(), ack_nack.begin() + kRtpsHeaderBytes, ack_nack.end());
  EXPECT_EQ(assembly_.WithQuestions(ack_nack), bytes);
  EXPECT_TRUE(Take(Of({{.first = 3}})).empty());
  expected = Datagram();
  question(expected, 1, 2).U32(0x80000000).U32(3).End();
  const Bytes next = assembly_.WithQuestions(ack_nack);
  ASSERT_GE(next.size(), expected.bytes().size());
  EXPECT_EQ(Bytes(next.begin(), next.begin() + static_cast<std::ptrdiff_t>(expected.bytes().size())), expected.bytes());
  EXPECT_EQ(Take(Of({{.first = 2}})), Only(Whole({}).bytes()));
}

TEST_F(FragmentAssemblyTest, AsksNobodyElse) {
  Datagram other_writer, heartbeat;
  other_writer.Begin(kInfoDestination, 0).U32(0x03020100).U32(0x07060504).U32(0x0b0a0908).End();
  other_writer.Begin(kAckNack, 0).U32(0x07000000 | kWriterKind).U32(0x03000000 | kWriterKind);
  other_writer.Sequence(1).U32(3).U32(0xa0000000).U32(9).End();
  EXPECT_TRUE(Take(Of({{}})).empty());
  EXPECT_TRUE(assembly_.WithQuestions(other_writer.bytes()).empty());
  EXPECT_TRUE(assembly_.WithQuestions(heartbeat.Heartbeat(1, 1).bytes()).empty());
}

TEST_F(FragmentAssemblyTest, TheOldestAreForgottenFirst) {
  EXPECT_TRUE(Take(Of({{.sequence = 1, .count = 2}})).empty());
  for (std::int64_t sequence = 2; sequence < 6000; ++sequence) {
    EXPECT_TRUE(Take(Of({{.sequence = sequence, .count = 2}})).empty());
    ASSERT_LE(assembly_.bytes(), FragmentAssembly::kMaxBytes);
  }
  EXPECT_TRUE(Take(Of({{.sequence = 1, .first = 3}})).empty());
  EXPECT_EQ(Take(Of({{.sequence = 5999, .first = 3}})), Only(Whole({.sequence = 5999}).bytes()));
}

}  // namespace
}  // namespace cairn::wire
