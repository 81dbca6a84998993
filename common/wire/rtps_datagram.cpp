#include "common/wire/rtps_datagram.h"

#include <algorithm>
#include <cstring>

#include "common/wire/limits.h"
#include "common/wire/secure_datagram.h"

namespace cairn::wire {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kHeaderBytes = 20;
constexpr std::size_t kGuidPrefixOffset = 8;
constexpr std::uint32_t kMaxSetBits = 256;

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
struct Reader {
  Bytes bytes;
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
  Reader body;
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
std::size_t EndOfParameters(const Reader& body, std::size_t at) {
  constexpr std::uint16_t kSentinel = 1;
  constexpr std::uint16_t kKeyHash = 0x70;
  constexpr std::uint16_t kStatusInfo = 0x71;
  while (at + 4 <= body.bytes.size()) {
    const std::uint16_t id = body.U16(at);
    const std::uint16_t length = body.U16(at + 2);
    at += 4;
    if (id == kSentinel) return at;
    if (length > body.bytes.size() - at) return 0;
    if (id == kKeyHash && length != 16) return 0;
    if (id == kStatusInfo && length != 4) return 0;
    at += length;
  }
  return 0;
}

SequenceGate::GuidPrefix PrefixAt(Bytes bytes, std::size_t at) {
  SequenceGate::GuidPrefix prefix;
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), prefix.size(), prefix.begin());
  return prefix;
}

// Whether a sequence number set fits: its bit count stands at `at`, then come the words of bits, and `tail`
// more bytes.
bool SetFits(const Submessage& m, std::size_t at, std::size_t tail) {
  if (m.size() < at + 4) return false;
  const std::uint32_t bits = m.body.U32(at);
  return bits <= kMaxSetBits && m.size() >= at + 4 + (bits + 31) / 32 * 4 + tail;
}

// The highest number in the set whose base stands at `base`, 0 where it is empty. REQUIRES: it fits.
std::int64_t HighestOf(const Submessage& m, std::size_t base) {
  const std::uint32_t bits = m.body.U32(base + 8);
  for (std::uint32_t i = bits; i-- > 0;) {
    if ((m.body.U32(base + 12 + i / 32 * 4) & (std::uint32_t{1} << (31 - i % 32))) != 0) {
      return m.body.Sequence(base) + i;
    }
  }
  return 0;
}

// Steps over the inline QoS of DATA and DATA_FRAG, which follows `fixed` bytes. Returns where the payload
// starts, or 0 if the inline QoS is broken.
std::size_t PayloadStart(const Submessage& m, std::size_t fixed) {
  constexpr std::uint8_t kInlineQos = 0x02;
  const std::size_t qos = 4 + static_cast<std::size_t>(m.body.U16(2));
  if (qos < fixed || qos > m.size()) return 0;
  return (m.flags & kInlineQos) != 0 ? EndOfParameters(m.body, qos) : qos;
}

// Entity ids of the built-in participants, writers and readers (RTPS 9.3.1.5).
bool IsDiscoveryWriter(Bytes entity) {
  constexpr std::array<std::uint8_t, 3> kParticipants = {0x00, 0x01, 0x00};
  constexpr std::array<std::uint8_t, 3> kWriters = {0x00, 0x00, 0x03};
  constexpr std::array<std::uint8_t, 3> kReaders = {0x00, 0x00, 0x04};
  constexpr std::uint8_t kBuiltinWriterWithKey = 0xc2;
  const auto is = [&](const auto& key) { return std::equal(key.begin(), key.end(), entity.begin()); };
  return entity[3] == kBuiltinWriterWithKey && (is(kParticipants) || is(kWriters) || is(kReaders));
}

// The endpoints of handshakes (DDS-SECURITY 7.4.7.1). A message may name only one of them.
bool IsHandshake(Bytes entities) {
  constexpr std::array<std::uint8_t, 4> kReader = {0x00, 0x02, 0x01, 0xc4};
  constexpr std::array<std::uint8_t, 4> kWriter = {0x00, 0x02, 0x01, 0xc3};
  return std::equal(kReader.begin(), kReader.end(), entities.begin()) ||
         std::equal(kWriter.begin(), kWriter.end(), entities.begin() + 4);
}

// Whether the security tokens in a whole parameter list are whole.
bool TokensAreWhole(const Reader& list) {
  constexpr std::uint16_t kSentinel = 1;
  constexpr std::uint16_t kIdentityToken = 0x1001;
  constexpr std::uint16_t kPermissionsToken = 0x1002;
  for (std::size_t at = 0; list.U16(at) != kSentinel; at += 4 + list.U16(at + 2)) {
    const std::uint16_t id = list.U16(at);
    if (id != kIdentityToken && id != kPermissionsToken) continue;
    if (at % 4 != 0 || !IsWholeToken(list.bytes.subspan(at + 4, list.U16(at + 2)), list.little)) return false;
  }
  return true;
}

// What arrives is inspected with these.
struct Inspection {
  SequenceGate& gate;
  SequenceGate::Clock::time_point now;

  [[nodiscard]] bool Accepts(const SequenceGate::Key& whose, std::int64_t number) const {
    return gate.Accept(whose, number, now);
  }
};

DatagramFault InspectData(const Submessage& m, const Inspection& with) {
  constexpr std::uint8_t kHasData = 0x04;
  constexpr std::uint8_t kHasKey = 0x08;
  constexpr std::uint8_t kParameterListEncoding = 0x02;  // PL_CDR_BE; PL_CDR_LE is one more.
  if (m.size() < 20) return DatagramFault::kFraming;
  const std::int64_t sequence = m.body.Sequence(12);
  if (sequence <= 0 || !with.Accepts(m.Numbers(8), sequence)) return DatagramFault::kSequence;
  const std::size_t payload = PayloadStart(m, 20);
  if (payload == 0) return DatagramFault::kParameterList;
  if ((m.flags & (kHasData | kHasKey)) == 0) return DatagramFault::kNone;
  if (m.size() < payload + 4) return DatagramFault::kFraming;
  // Discovery data are parameter lists, which the library itself parses. Other built-in data may be labelled
  // as a parameter list without being one, such as the liveliness messages of Fast DDS.
  const Bytes sample = m.body.bytes.subspan(payload);
  if (IsHandshake(m.body.bytes.subspan(4, 8))) {
    return IsWholeHandshake(sample) ? DatagramFault::kNone : DatagramFault::kSecurity;
  }
  if (!HoldsItsCiphertext(sample, sample.size())) return DatagramFault::kSecurity;
  const std::uint8_t encoding = m.body.bytes[payload + 1];
  if (IsDiscoveryWriter(m.body.bytes.subspan(8, 4)) && (encoding & 0xfe) == kParameterListEncoding) {
    const Reader list{m.body.bytes.subspan(payload + 4), (encoding & 1) != 0};
    if (EndOfParameters(list, 0) == 0) return DatagramFault::kParameterList;
    if (!TokensAreWhole(list)) return DatagramFault::kSecurity;
  }
  return DatagramFault::kNone;
}

DatagramFault InspectDataFrag(const Submessage& m, const Inspection& with) {
  if (m.size() < 32) return DatagramFault::kFraming;
  const std::int64_t sequence = m.body.Sequence(12);
  if (sequence <= 0 || !with.Accepts(m.Numbers(8), sequence)) return DatagramFault::kSequence;
  const std::uint64_t start = m.body.U32(20);
  const std::uint64_t count = m.body.U16(24);
  const std::uint64_t fragment_bytes = m.body.U16(26);
  const std::uint64_t sample_bytes = m.body.U32(28);
  if (start == 0 || count == 0 || fragment_bytes == 0) return DatagramFault::kFragment;
  // These are small, and would be inspected only in part.
  if (IsDiscoveryWriter(m.body.bytes.subspan(8, 4)) || IsHandshake(m.body.bytes.subspan(4, 8)))
    return DatagramFault::kFragment;
  if (sample_bytes == 0 || sample_bytes > kMaxSampleBytes) return DatagramFault::kFragment;
  const std::uint64_t fragments = (sample_bytes + fragment_bytes - 1) / fragment_bytes;
  if (start + count - 1 > fragments) return DatagramFault::kFragment;
  const std::size_t payload = PayloadStart(m, 32);
  if (payload == 0) return DatagramFault::kParameterList;
  const std::uint64_t end = std::min(sample_bytes, (start + count - 1) * fragment_bytes);
  if (m.size() - payload < end - (start - 1) * fragment_bytes) return DatagramFault::kFragment;
  const bool whole = start > 1 || HoldsItsCiphertext(m.body.bytes.subspan(payload), sample_bytes);
  return whole ? DatagramFault::kNone : DatagramFault::kSecurity;
}

DatagramFault InspectHeartbeat(const Submessage& m, const Inspection& with) {
  constexpr SequenceGate::EntityId kCounts = 1;
  if (m.size() < 28) return DatagramFault::kFraming;
  const std::int64_t first = m.body.Sequence(8);
  const std::int64_t last = m.body.Sequence(16);
  // In the heartbeat of an empty history first = last + 1.
  if (first <= 0 || last < first - 1 || !with.Accepts(m.Numbers(4), last)) return DatagramFault::kSequence;
  return with.Accepts(m.Numbers(4, kCounts), m.body.U32(24)) ? DatagramFault::kNone : DatagramFault::kCount;
}

DatagramFault InspectGap(const Submessage& m, const Inspection& with) {
  constexpr std::int64_t kLongest = std::int64_t{1} << 30;  // The library loops over every number from start to base.
  if (m.size() < 28) return DatagramFault::kFraming;
  if (!SetFits(m, 24, 0)) return DatagramFault::kSequenceSet;
  const std::int64_t start = m.body.Sequence(8);
  const std::int64_t base = m.body.Sequence(16);
  if (start <= 0 || base < start || base - start > kLongest) return DatagramFault::kSequence;
  const std::int64_t last = std::max(base - 1, HighestOf(m, 16));
  return with.Accepts(m.Numbers(4), last) ? DatagramFault::kNone : DatagramFault::kSequence;
}

DatagramFault InspectAck(const Submessage& m, const Inspection& with) {
  if (m.size() < 24) return DatagramFault::kFraming;
  const std::int64_t base = m.body.Sequence(8);
  if (base < 0) return DatagramFault::kSequence;
  if (!SetFits(m, 16, 4)) return DatagramFault::kSequenceSet;
  const auto sent = with.gate.LastSent(m.to, m.Entity(4));
  if (!sent) return DatagramFault::kNone;  // For another participant.
  if (base > *sent + 1 || HighestOf(m, 8) > *sent) return DatagramFault::kUnsent;
  const std::size_t count = 20 + (m.body.U32(16) + 31) / 32 * 4;
  return with.Accepts(m.Numbers(0, m.Entity(4)), m.body.U32(count)) ? DatagramFault::kNone : DatagramFault::kCount;
}

DatagramFault InspectNackFrag(const Submessage& m, const Inspection& with) {
  constexpr SequenceGate::EntityId kFragments = 0xffffffff;
  if (m.size() < 28) return DatagramFault::kFraming;
  const std::int64_t sequence = m.body.Sequence(8);
  if (sequence <= 0) return DatagramFault::kSequence;
  if (!SetFits(m, 20, 4)) return DatagramFault::kSequenceSet;
  const auto sent = with.gate.LastSent(m.to, m.Entity(4));
  if (!sent) return DatagramFault::kNone;
  if (sequence > *sent) return DatagramFault::kUnsent;
  const std::size_t count = 24 + (m.body.U32(20) + 31) / 32 * 4;
  return with.Accepts(m.Numbers(0, m.Entity(4) ^ kFragments), m.body.U32(count)) ? DatagramFault::kNone
                                                                                 : DatagramFault::kCount;
}

DatagramFault InspectSubmessage(const Submessage& m, const Inspection& with) {
  constexpr std::uint8_t kNoTimestamp = 0x02;
  const auto at_least = [&](std::size_t n) { return m.size() >= n ? DatagramFault::kNone : DatagramFault::kFraming; };
  switch (m.id) {
    case kData:
      return InspectData(m, with);
    case kDataFrag:
      return InspectDataFrag(m, with);
    case kHeartbeat:
      return InspectHeartbeat(m, with);
    case kGap:
      return InspectGap(m, with);
    case kAckNack:
      return InspectAck(m, with);
    case kNackFrag:
      return InspectNackFrag(m, with);
    case kHeartbeatFrag:
      return at_least(24);
    case kInfoTimestamp:
      return at_least((m.flags & kNoTimestamp) != 0 ? 0 : 8);
    case kInfoSource:
      return at_least(20);
    case kInfoDestination:
      return at_least(12);
    default:  // Receivers skip unknown submessages.
      return IsWholeProtection(m.id, m.body.bytes) ? DatagramFault::kNone : DatagramFault::kSecurity;
  }
}

// Gives each submessage to `inspect` until one has a fault.
template <typename Inspect>
DatagramFault Walk(Bytes datagram, Inspect inspect) {
  constexpr std::uint8_t kMajorVersion = 2;
  if (datagram.size() < kHeaderBytes || std::memcmp(datagram.data(), "RTPS", 4) != 0) return DatagramFault::kNotRtps;
  if (datagram[4] != kMajorVersion) return DatagramFault::kNotRtps;
  SequenceGate::GuidPrefix from = PrefixAt(datagram, kGuidPrefixOffset);
  SequenceGate::GuidPrefix to{};
  std::size_t at = kHeaderBytes;
  while (at < datagram.size()) {
    if (datagram.size() - at < 4) return DatagramFault::kFraming;
    const std::uint8_t id = datagram[at];
    const std::uint8_t flags = datagram[at + 1];
    const bool little = (flags & 1) != 0;
    const std::size_t length = Reader{datagram, little}.U16(at + 2);
    // Length 0 means "to the end of the datagram", except for the two kinds of submessage that may be empty.
    const bool to_the_end = length == 0 && id != kPad && id != kInfoTimestamp;
    const std::size_t end = to_the_end ? datagram.size() : at + 4 + length;
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

}  // namespace

std::string_view DatagramFaultName(DatagramFault fault) {
  static constexpr std::array<std::string_view, kDatagramFaults> kNames = {
      "none",   "not_rtps",     "framing",  "statistics",     "sequence", "count",
      "unsent", "sequence_set", "fragment", "parameter_list", "security"};
  return kNames[static_cast<std::size_t>(fault)];
}

DatagramFault InspectDatagram(Bytes datagram, SequenceGate& gate, SequenceGate::Clock::time_point now) {
  const Inspection with{gate, now};
  return Walk(datagram, [&](const Submessage& submessage) { return InspectSubmessage(submessage, with); });
}

FragmentTraffic FragmentTrafficOf(Bytes datagram) {
  FragmentTraffic traffic;
  static_cast<void>(Walk(datagram, [&](const Submessage& m) {
    if (m.id == kGap) traffic.gap = true;
    if (m.id != kDataFrag) return DatagramFault::kNone;
    traffic.fragments.push_back({.sample = {m.Numbers(8, m.Entity(4)), m.body.Sequence(12)},
                                 .first = m.body.U32(20),
                                 .count = m.body.U16(24),
                                 .fragment_bytes = m.body.U16(26),
                                 .sample_bytes = m.body.U32(28)});
    return DatagramFault::kNone;
  }));
  return traffic;
}

void NoteSent(Bytes datagram, SequenceGate& gate) {
  static_cast<void>(Walk(datagram, [&](const Submessage& m) {
    if (m.id == kData || m.id == kDataFrag) gate.Sent(m.from, m.Entity(8), m.body.Sequence(12));
    if (m.id == kHeartbeat) gate.Sent(m.from, m.Entity(4), m.body.Sequence(16));
    if (m.id == kGap) gate.Sent(m.from, m.Entity(4), std::max(m.body.Sequence(16) - 1, HighestOf(m, 16)));
    return DatagramFault::kNone;
  }));
}

}  // namespace cairn::wire
