// The submessages of an RTPS datagram, one after the other, with the sender and the receiver that they have.
// Source: OMG DDSI-RTPS 2.3, sections 8.3.4, 9.4.4 and 9.4.5.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "common/wire/rtps_datagram.h"
#include "common/wire/sequence_gate.h"

namespace cairn::wire {

inline constexpr std::size_t kRtpsHeaderBytes = 20;

enum SubmessageId : std::uint8_t {
  kPad = 0x01,
  kAckNack = 0x06,
  kHeartbeat = 0x07,
  kGap = 0x08,
  kInfoTimestamp = 0x09,
  kInfoSource = 0x0c,
  kInfoDestination = 0x0e,
  kNackFrag = 0x12,
  kHeartbeatFrag = 0x13,
  kData = 0x15,
  kDataFrag = 0x16,
  kEprosimaStatistics = 0x80,
};

// Reads numbers in the byte order of one submessage. The caller must check the size first.
struct SubmessageReader {
  std::span<const std::uint8_t> bytes;
  bool little;

  [[nodiscard]] std::uint16_t U16(std::size_t at) const {
    return static_cast<std::uint16_t>(little ? bytes[at] | bytes[at + 1] << 8 : bytes[at] << 8 | bytes[at + 1]);
  }
  [[nodiscard]] std::uint32_t U32(std::size_t at) const {
    const std::uint32_t first = U16(at);
    const std::uint32_t second = U16(at + 2);
    return little ? first | second << 16 : first << 16 | second;
  }
  // A sequence number: high word first, whatever the byte order.
  [[nodiscard]] std::int64_t Sequence(std::size_t at) const {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(U32(at)) << 32 | U32(at + 4));
  }
};

// A submessage, its sender and its receiver.
struct Submessage {
  std::uint8_t id;
  std::uint8_t flags;
  SubmessageReader body;
  SequenceGate::GuidPrefix from;
  SequenceGate::GuidPrefix to;  // All zero: everybody.

  [[nodiscard]] std::size_t size() const { return body.bytes.size(); }
  [[nodiscard]] SequenceGate::EntityId Entity(std::size_t at) const {
    SequenceGate::EntityId entity = 0;
    std::memcpy(&entity, body.bytes.data() + at, sizeof(entity));
    return entity;
  }
  // The numbers of the sender's entity whose id stands at `at`; of what it numbers, where there are several things.
  [[nodiscard]] SequenceGate::Key Numbers(std::size_t at, SequenceGate::EntityId what = 0) const {
    SequenceGate::Key key;
    std::copy(from.begin(), from.end(), key.begin());
    std::copy_n(body.bytes.begin() + static_cast<std::ptrdiff_t>(at), 4, key.begin() + 12);
    std::memcpy(key.data() + 16, &what, sizeof(what));
    return key;
  }
};

// Steps over a parameter list; returns where it ends, or 0 if it is broken.
[[nodiscard]] std::size_t EndOfParameters(const SubmessageReader& body, std::size_t at);
// Steps over the inline QoS of DATA and DATA_FRAG, which follows `fixed` bytes. Returns where the payload
// starts, or 0 if the inline QoS is broken. REQUIRES: the submessage has `fixed` bytes.
[[nodiscard]] std::size_t PayloadStart(const Submessage& m, std::size_t fixed);
[[nodiscard]] SequenceGate::GuidPrefix PrefixAt(std::span<const std::uint8_t> bytes, std::size_t at);

// Length 0 means "to the end of the datagram", except for the two kinds of submessage that may be empty.
[[nodiscard]] inline bool EndsWithDatagram(std::uint8_t id, std::size_t length) {
  return length == 0 && id != kPad && id != kInfoTimestamp;
}

// Gives each submessage to `inspect` until one has a fault.
template <typename Inspect>
[[nodiscard]] DatagramFault Walk(std::span<const std::uint8_t> datagram, Inspect inspect) {
  constexpr std::uint8_t kMajorVersion = 2;
  constexpr std::size_t kGuidPrefixOffset = 8;
  if (datagram.size() < kRtpsHeaderBytes || std::memcmp(datagram.data(), "RTPS", 4) != 0)
    return DatagramFault::kNotRtps;
  if (datagram[4] != kMajorVersion) return DatagramFault::kNotRtps;
  SequenceGate::GuidPrefix from = PrefixAt(datagram, kGuidPrefixOffset);
  SequenceGate::GuidPrefix to{};
  std::size_t at = kRtpsHeaderBytes;
  while (at < datagram.size()) {
    if (datagram.size() - at < 4) return DatagramFault::kFraming;
    const std::uint8_t id = datagram[at];
    const std::uint8_t flags = datagram[at + 1];
    const bool little = (flags & 1) != 0;
    const std::size_t length = SubmessageReader{datagram, little}.U16(at + 2);
    const std::size_t end = EndsWithDatagram(id, length) ? datagram.size() : at + 4 + length;
    if (end > datagram.size()) return DatagramFault::kFraming;
    // All but the last are multiples of four bytes (9.4.5.1.3). Receivers differ in where the next one of another
    // length begins: what is harmless here may be something else there.
    if (end != datagram.size() && length % 4 != 0) return DatagramFault::kFraming;
    if (id == kEprosimaStatistics && end != datagram.size()) return DatagramFault::kStatistics;
    const Submessage submessage{id, flags, {datagram.subspan(at + 4, end - at - 4), little}, from, to};
    const DatagramFault fault = inspect(submessage);
    if (fault != DatagramFault::kNone) return fault;
    if (id == kInfoSource) from = PrefixAt(submessage.body.bytes, 8);  // The sender of what follows.
    if (id == kInfoDestination) to = PrefixAt(submessage.body.bytes, 0);
    at = end;
  }
  return DatagramFault::kNone;
}

}  // namespace cairn::wire
