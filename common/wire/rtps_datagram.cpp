#include "common/wire/rtps_datagram.h"

#include <algorithm>

#include "common/wire/limits.h"
#include "common/wire/rtps_submessage.h"
#include "common/wire/secure_datagram.h"

namespace cairn::wire {
namespace {

using Bytes = std::span<const std::uint8_t>;
using Reader = SubmessageReader;

constexpr std::uint32_t kMaxSetBits = 256;

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
  constexpr std::uint8_t kHasKey = 0x04;
  if (m.size() < 32) return DatagramFault::kFraming;
  const std::int64_t sequence = m.body.Sequence(12);
  if (sequence <= 0 || !with.Accepts(m.Numbers(8), sequence)) return DatagramFault::kSequence;
  const std::uint64_t start = m.body.U32(20);
  const std::uint64_t count = m.body.U16(24);
  const std::uint64_t fragment_bytes = m.body.U16(26);
  const std::uint64_t sample_bytes = m.body.U32(28);
  if (start == 0 || count == 0 || fragment_bytes == 0) return DatagramFault::kFragment;
  // These are small, and would be inspected only in part, because with DDS Security fragments are not assembled.
  if (IsHandshake(m.body.bytes.subspan(4, 8))) return DatagramFault::kFragment;
  // Fast DDS would deliver a fragmented key as a sample with whatever the memory held before.
  if ((m.flags & kHasKey) != 0) return DatagramFault::kFragment;
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
  if (m.size() < 28) return DatagramFault::kFraming;
  const std::int64_t first = m.body.Sequence(8);
  const std::int64_t last = m.body.Sequence(16);
  // In the heartbeat of an empty history first = last + 1.
  const bool plausible = first > 0 && last >= first - 1 && with.Accepts(m.Numbers(4), last);
  return plausible ? DatagramFault::kNone : DatagramFault::kSequence;
}

DatagramFault InspectGap(const Submessage& m, const Inspection& with) {
  if (m.size() < 28) return DatagramFault::kFraming;
  if (!SetFits(m, 24, 0)) return DatagramFault::kSequenceSet;
  const std::int64_t start = m.body.Sequence(8);
  const std::int64_t base = m.body.Sequence(16);
  if (start <= 0 || base < start) return DatagramFault::kSequence;
  if (base - start > kMaxGap && !with.gate.Reached(m.Numbers(4), base - 1)) return DatagramFault::kSequence;
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
  return base > *sent + 1 || HighestOf(m, 8) > *sent ? DatagramFault::kUnsent : DatagramFault::kNone;
}

DatagramFault InspectNackFrag(const Submessage& m, const Inspection& with) {
  if (m.size() < 28) return DatagramFault::kFraming;
  const std::int64_t sequence = m.body.Sequence(8);
  if (sequence <= 0) return DatagramFault::kSequence;
  if (!SetFits(m, 20, 4)) return DatagramFault::kSequenceSet;
  const auto sent = with.gate.LastSent(m.to, m.Entity(4));
  if (!sent) return DatagramFault::kNone;
  return sequence > *sent ? DatagramFault::kUnsent : DatagramFault::kNone;
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

}  // namespace

std::string_view DatagramFaultName(DatagramFault fault) {
  static constexpr std::array<std::string_view, kDatagramFaults> kNames = {
      "none",   "not_rtps",     "framing",  "statistics",     "sequence",
      "unsent", "sequence_set", "fragment", "parameter_list", "security"};
  return kNames[static_cast<std::size_t>(fault)];
}

Bytes WithoutStatistics(Bytes datagram) {
  for (std::size_t at = kRtpsHeaderBytes; at + 4 <= datagram.size();) {
    const std::size_t length = SubmessageReader{datagram, (datagram[at + 1] & 1) != 0}.U16(at + 2);
    const bool to_the_end = EndsWithDatagram(datagram[at], length) || at + 4 + length >= datagram.size();
    if (to_the_end) return datagram[at] == kEprosimaStatistics ? datagram.first(at) : datagram;
    at += 4 + length;
  }
  return datagram;
}

DatagramFault InspectDatagram(Bytes datagram, SequenceGate& gate, SequenceGate::Clock::time_point now) {
  const Inspection with{gate, now};
  const DatagramFault fault =
      Walk(datagram, [&](const Submessage& submessage) { return InspectSubmessage(submessage, with); });
  return fault != DatagramFault::kNone || IsWholeIfSigned(datagram) ? fault : DatagramFault::kSecurity;
}

std::vector<std::uint8_t> WithOwnCounts(std::span<const std::uint8_t> datagram, SequenceGate& gate) {
  constexpr std::uint8_t kSigned = 0x33;  // SRTPS_PREFIX (DDS Security 1.1, 7.3.6.6).
  // A writer counts its heartbeats; a reader its acknowledgements to each writer, and its requests for fragments.
  constexpr SequenceGate::EntityId kHeartbeats = 1, kFragments = 0xffffffff;
  struct Count {
    std::size_t at;
    bool little;
    SequenceGate::Key whose;
  };
  std::vector<Count> counts;
  bool is_signed = false;
  static_cast<void>(Walk(datagram, [&](const Submessage& m) {
    const auto begin = static_cast<std::size_t>(m.body.bytes.data() - datagram.data());
    const auto behind_set = [&](std::size_t set) { return begin + set + 4 + (m.body.U32(set) + 31) / 32 * 4; };
    is_signed = is_signed || m.id == kSigned;
    if (m.id == kHeartbeat) counts.push_back({begin + 24, m.body.little, m.Numbers(4, kHeartbeats)});
    if (m.id == kAckNack) counts.push_back({behind_set(16), m.body.little, m.Numbers(0, m.Entity(4))});
    if (m.id == kNackFrag) counts.push_back({behind_set(20), m.body.little, m.Numbers(0, m.Entity(4) ^ kFragments)});
    return DatagramFault::kNone;
  }));
  if (counts.empty() || is_signed) return {};
  std::vector<std::uint8_t> changed(datagram.begin(), datagram.end());
  for (const Count& count : counts) {
    const std::uint32_t number = gate.NextCount(count.whose);
    for (std::size_t byte = 0; byte < 4; ++byte)
      changed[count.at + (count.little ? byte : 3 - byte)] = static_cast<std::uint8_t>(number >> 8 * byte);
  }
  return changed;
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
