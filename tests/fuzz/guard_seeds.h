// Datagrams as senders make them, which depend on each other or are of DDS Security: seeds of the target `guard`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "common/wire/rtps_submessage.h"
#include "tests/common/wire/datagram.h"
#include "tests/fuzz/fuzz_target.h"

namespace cairn::fuzz {

using wire::test::Datagram;

inline constexpr std::uint32_t kSeedWriter = 0x02000000, kSeedReader = 0x07000000;
inline constexpr std::int64_t kOwnLast = 40;  // The participant of the target has sent so many samples.

inline Datagram& To(Datagram& datagram, const char* prefix) {
  datagram.Begin(wire::kInfoDestination, 0);
  for (int i = 0; i < 12; ++i) datagram.Byte(static_cast<std::uint8_t>(prefix[i]));
  return datagram.End();
}

inline constexpr char kOwnPrefix[] = "own prefix i";
// As the class Datagram fills it in.
inline constexpr char kSenderPrefix[] = "\0\1\2\3\4\5\6\7\x8\x9\xa\xb";

// A datagram of the participant whose guard is tested.
inline Datagram OwnDatagram() {
  Datagram datagram;
  datagram.Begin(wire::kInfoSource, 0).U32(0).U16(0x0302).U16(0x0f01);
  for (int i = 0; i < 12; ++i) datagram.Byte(static_cast<std::uint8_t>(kOwnPrefix[i]));
  datagram.End();
  datagram.Begin(wire::kHeartbeat, 0).U32(0).U32(kSeedWriter).Sequence(1).Sequence(kOwnLast).U32(1).End();
  return datagram;
}

inline Datagram& Ack(Datagram& datagram, std::int64_t base, std::uint32_t bits) {
  datagram.Begin(wire::kAckNack, 0).U32(kSeedReader).U32(kSeedWriter).Sequence(base).U32(bits);
  for (std::uint32_t word = 0; word < (bits + 31) / 32; ++word) datagram.U32(0x80000000);
  return datagram.U32(3).End();
}

inline Datagram& Gap(Datagram& datagram, std::int64_t first, std::int64_t base, std::uint32_t bits) {
  datagram.Begin(wire::kGap, 0).U32(kSeedReader).U32(kSeedWriter).Sequence(first).Sequence(base).U32(bits);
  for (std::uint32_t word = 0; word < (bits + 31) / 32; ++word) datagram.U32(0xa0000001);
  return datagram.End();
}

// Fragments of 40 bytes of a sample of 100, with its key as inline QoS.
inline Datagram& Fragments(Datagram& datagram, std::int64_t sequence, std::uint32_t first, std::uint16_t count) {
  constexpr std::uint32_t kSample = 100, kFragment = 40;
  datagram.Begin(wire::kDataFrag, wire::test::kInlineQos)
      .U16(0)
      .U16(28)
      .U32(kSeedReader)
      .U32(kSeedWriter)
      .Sequence(sequence);
  datagram.U32(first).U16(count).U16(kFragment).U32(kSample);
  datagram.U16(0x70).U16(16).U32(5).U32(6).U32(7).U32(8).U16(1).U16(0);
  return datagram.Zeros(std::min(first * kFragment + (count - 1) * kFragment, kSample) - (first - 1) * kFragment).End();
}

inline Datagram& DataOf(Datagram& datagram, std::uint32_t reader, std::uint32_t writer, std::uint16_t encoding) {
  datagram.Begin(wire::kData, wire::test::kHasData).U16(0).U16(16).U32(reader).U32(writer).Sequence(1);
  return datagram.U16(encoding).U16(0);
}

// The beginning and the end of what DDS Security protects; `ciphertext` between them.
inline Datagram& CryptoHeader(Datagram& datagram, std::uint8_t id) {
  return datagram.Begin(id, 0).BigEndian(4).Zeros(16).End();
}
inline Datagram& CryptoFooter(Datagram& datagram, std::uint8_t id, std::uint32_t receivers) {
  return datagram.Begin(id, 0).Zeros(16).BigEndian(receivers).Zeros(std::size_t{20} * receivers).End();
}

inline std::vector<Datagram> SecureDatagrams() {
  constexpr std::uint8_t kSecBody = 0x30, kSecPrefix = 0x31, kSecPostfix = 0x32, kRtpsPrefix = 0x33,
                         kRtpsPostfix = 0x34;
  Datagram encrypted, whole, announcement, handshake, sample, fragment;
  CryptoHeader(encrypted, kSecPrefix).Begin(kSecBody, 0).BigEndian(32).Zeros(32).End();
  CryptoFooter(encrypted, kSecPostfix, 2);
  CryptoHeader(whole, kRtpsPrefix).Heartbeat(1, 2);
  CryptoFooter(whole, kRtpsPostfix, 1);
  DataOf(announcement, 0, 0xc2000100, 0x0300);
  for (const std::uint16_t token : {0x1001, 0x1002}) {
    announcement.U16(token).U16(32).Text("PKI").U32(1).Text("a").Text("b").U32(0);
  }
  announcement.U16(1).U16(0).End();
  DataOf(handshake, 0xc4010200, 0xc3010200, 0x0100).Zeros(96).Text("dds.auth");
  handshake.U32(1).Text("PKI").U32(1).Text("a").Text("b").U32(1).Text("dh1").Text("12345678").End();
  sample.Begin(wire::kData, wire::test::kHasData).U16(0).U16(16).U32(kSeedReader).U32(kSeedWriter).Sequence(1);
  sample.BigEndian(4).Zeros(16).BigEndian(16).Zeros(16).Zeros(20).End();
  fragment.Begin(wire::kDataFrag, 0).U16(0).U16(28).U32(kSeedReader).U32(kSeedWriter).Sequence(1).U32(1).U16(1).U16(40);
  fragment.U32(100).BigEndian(4).Zeros(16).BigEndian(56).Zeros(16).End();
  return {encrypted, whole, announcement, handshake, sample, fragment};
}

// Conversations: several datagrams of the same traffic.
inline std::vector<std::vector<Datagram>> Conversations() {
  const auto one = [](const auto& fill) {
    Datagram datagram;
    fill(datagram);
    return datagram;
  };
  const Datagram lost_heartbeat = one([](Datagram& d) { d.Heartbeat(1, 3); });
  const Datagram asks = one([](Datagram& d) { Ack(To(d, kSenderPrefix), 1, 3); });
  return {
      // Acknowledgements of what the participant sent, the last one of more than that.
      {one([](Datagram& d) { Ack(To(d, kOwnPrefix), kOwnLast + 1, 0); }),
       one([](Datagram& d) { Ack(To(d, kOwnPrefix), 5, 12); }), one([](Datagram& d) { Ack(To(d, kOwnPrefix), 5, 40); }),
       one([](Datagram& d) { Ack(To(d, kOwnPrefix), kOwnLast + 2, 0); })},
      // Requests for its fragments.
      {one([](Datagram& d) {
        To(d, kOwnPrefix).Begin(wire::kNackFrag, 0).U32(kSeedReader).U32(kSeedWriter).Sequence(kOwnLast).U32(1);
        d.U32(33).U32(0xc0000000).U32(0x80000000).U32(1).End();
      })},
      // A sample in three fragments, the last one short, with the heartbeats of both kinds, in order;
      {one([](Datagram& d) { Fragments(d, 1, 1, 1); }), one([](Datagram& d) {
         Fragments(d, 1, 2, 1)
             .Begin(wire::kHeartbeatFrag, 0)
             .U32(kSeedReader)
             .U32(kSeedWriter)
             .Sequence(1)
             .U32(2)
             .U32(1)
             .End();
       }),
       one([](Datagram& d) { Fragments(d, 1, 3, 1).Heartbeat(1, 1); })},
      // backwards, where the reader asks for the others meanwhile;
      {one([](Datagram& d) { Fragments(d, 1, 3, 1); }), lost_heartbeat, asks,
       one([](Datagram& d) { Fragments(d, 1, 1, 2); }), asks},
      // two samples in turns, both in one datagram, and a gap where they were.
      {one([](Datagram& d) { Fragments(Fragments(d, 1, 1, 1), 2, 1, 2); }), lost_heartbeat,
       one([](Datagram& d) { Gap(d, 1, 3, 0); }), one([](Datagram& d) { Fragments(Fragments(d, 2, 3, 1), 1, 2, 2); })},
      // The longest gap, gaps with sets, and heartbeats that grow.
      {one([](Datagram& d) { Gap(d, 1, 1 + wire::kMaxGap, 0); })},
      {one([](Datagram& d) { d.Heartbeat(1, 1); }), one([](Datagram& d) { Gap(d, 1, 4, 96); }),
       one([](Datagram& d) { d.Heartbeat(90, 101); }), one([](Datagram& d) { d.Heartbeat(102, 101); }),
       one([](Datagram& d) { Gap(d, 102, 103, 256); })},
  };
}

inline std::string DatagramPiece(const Datagram& datagram) {
  return Piece({reinterpret_cast<const char*>(datagram.bytes().data()), datagram.bytes().size()});
}

}  // namespace cairn::fuzz
