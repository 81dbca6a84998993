#include "common/wire/fragment_assembly.h"

#include <algorithm>

namespace cairn::wire {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kSampleBytes = 512;  // About what a sample takes beside its pieces,
constexpr std::size_t kPieceBytes = 64;    // and a piece beside its payload.
constexpr std::uint8_t kLittleEndian = 1;
constexpr std::size_t kFragmentQos = 32;  // Where the inline QoS of DATA_FRAG begins.

// The fields of DATA_FRAG behind its sequence number.
std::uint32_t FirstFragment(const Submessage& m) {
  return m.body.U32(20);
}
std::uint16_t FragmentCount(const Submessage& m) {
  return m.body.U16(24);
}
std::uint16_t FragmentBytes(const Submessage& m) {
  return m.body.U16(26);
}
std::uint32_t SampleBytes(const Submessage& m) {
  return m.body.U32(28);
}

void Append(std::vector<std::uint8_t>& to, Bytes bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

// The submessage with its header.
void AppendSubmessage(std::vector<std::uint8_t>& to, const Submessage& m) {
  const auto length = static_cast<std::uint16_t>(m.size());
  const auto low = static_cast<std::uint8_t>(length), high = static_cast<std::uint8_t>(length >> 8);
  to.insert(to.end(), {m.id, m.flags, m.body.little ? low : high, m.body.little ? high : low});
  Append(to, m.body.bytes);
}

// DATA with the endpoints, the sequence number and the inline QoS of the fragment, up to the payload. Its length 0
// means "to the end of the datagram", because a sample may be longer than a submessage could say.
void AppendDataHead(std::vector<std::uint8_t>& to, const Submessage& m) {
  constexpr std::uint8_t kKept = 0x03;  // The byte order, and whether there is inline QoS.
  constexpr std::uint8_t kHasData = 0x04;
  constexpr std::uint8_t kDataQos = 16;
  const auto flags = static_cast<std::uint8_t>((m.flags & kKept) | kHasData);
  to.insert(to.end(), {kData, flags, 0, 0, 0, 0});
  to.insert(to.end(), {m.body.little ? kDataQos : std::uint8_t{0}, m.body.little ? std::uint8_t{0} : kDataQos});
  Append(to, m.body.bytes.subspan(4, 16));
  const std::size_t qos = 4 + static_cast<std::size_t>(m.body.U16(2));
  Append(to, m.body.bytes.subspan(qos, PayloadStart(m, kFragmentQos) - qos));
}

void Append32(std::vector<std::uint8_t>& to, std::uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) to.push_back(static_cast<std::uint8_t>(value >> shift));
}

// INFO_DST. All zero: what follows is for everybody.
void AppendDestination(std::vector<std::uint8_t>& to, const SequenceGate::GuidPrefix& prefix) {
  to.insert(to.end(), {kInfoDestination, kLittleEndian, static_cast<std::uint8_t>(prefix.size()), 0});
  Append(to, prefix);
}

// The fields of ACKNACK behind its endpoints: the lowest number that it may ask for, and a bit for each one from there.
bool AsksFor(const Submessage& ack_nack, std::int64_t sequence) {
  const std::int64_t base = ack_nack.body.Sequence(8);
  const std::uint32_t bits = ack_nack.body.U32(16);
  if (sequence < base || sequence - base >= bits) return false;
  const auto bit = static_cast<std::uint32_t>(sequence - base);
  return (ack_nack.body.U32(20 + 4 * std::size_t{bit / 32}) >> (31 - bit % 32) & 1) != 0;
}

bool IsAboutWhatFollows(const Submessage& m) {
  return m.id == kInfoTimestamp || m.id == kInfoSource || m.id == kInfoDestination;
}

}  // namespace

bool HasFragments(Bytes datagram) {
  bool has = false;
  static_cast<void>(Walk(datagram, [&](const Submessage& m) {
    has = has || m.id == kDataFrag;
    return DatagramFault::kNone;
  }));
  return has;
}

bool HasBuiltInFragments(Bytes datagram) {
  const auto built_in = [](std::uint8_t kind) { return (kind & 0xc0) == 0xc0; };  // RTPS 9.3.1.2.
  bool has = false;
  static_cast<void>(Walk(datagram, [&](const Submessage& m) {
    has = has || (m.id == kDataFrag && (built_in(m.body.bytes[7]) || built_in(m.body.bytes[11])));
    return DatagramFault::kNone;
  }));
  return has;
}

std::vector<FragmentAssembly::Datagram> FragmentAssembly::Take(Bytes datagram) {
  std::vector<Datagram> deliver;
  Datagram sender(datagram.begin(), datagram.begin() + kRtpsHeaderBytes);
  Datagram others = sender;
  bool has_others = false;
  static_cast<void>(Walk(datagram, [&](const Submessage& m) {
    if (m.id == kDataFrag) {
      if (Datagram whole = Add(m, sender); !whole.empty()) deliver.push_back(std::move(whole));
      return DatagramFault::kNone;
    }
    if (IsAboutWhatFollows(m)) {
      AppendSubmessage(sender, m);
    } else {
      has_others = true;
    }
    AppendSubmessage(others, m);
    return DatagramFault::kNone;
  }));
  if (has_others) deliver.push_back(std::move(others));
  return deliver;
}

FragmentAssembly::Datagram FragmentAssembly::WithQuestions(Bytes datagram) {
  if (samples_.empty()) return {};
  Datagram to_send;
  static_cast<void>(Walk(datagram, [&](const Submessage& m) {
    if (m.id == kAckNack) AppendQuestions(to_send, m);
    return DatagramFault::kNone;
  }));
  if (to_send.empty()) return {};
  // In front, because the last submessage may be one that reaches to the end of the datagram.
  const Bytes header = datagram.first(kRtpsHeaderBytes);
  to_send.insert(to_send.begin(), header.begin(), header.end());
  AppendDestination(to_send, SequenceGate::GuidPrefix{});
  Append(to_send, datagram.subspan(kRtpsHeaderBytes));
  return to_send;
}

void FragmentAssembly::AppendQuestions(Datagram& to, const Submessage& ack_nack) {
  constexpr int kMostSamples = 16;          // In one datagram. The next ACKNACK asks for others.
  constexpr std::uint32_t kMostBits = 256;  // Of a set of fragments (9.4.2.6).
  const Bytes reader = ack_nack.body.bytes.subspan(0, 4), writer = ack_nack.body.bytes.subspan(4, 4);
  Key from{};
  std::ranges::copy(ack_nack.to, from.first.begin());
  std::ranges::copy(writer, from.first.begin() + 12);
  const auto is_of_writer = [&from](const Key& key) {
    return std::equal(from.first.begin(), from.first.begin() + 16, key.first.begin());
  };
  int asked = 0;
  for (auto at = samples_.lower_bound(from); at != samples_.end() && is_of_writer(at->first); ++at) {
    if (!AsksFor(ack_nack, at->first.second)) continue;
    if (++asked > kMostSamples) return;
    const std::vector<bool>& arrived = at->second.arrived;
    const auto first = static_cast<std::uint32_t>(std::ranges::find(arrived, false) - arrived.begin());
    const std::uint32_t bits = std::min(kMostBits, static_cast<std::uint32_t>(arrived.size()) - first);
    std::array<std::uint32_t, kMostBits / 32> missing{};
    for (std::uint32_t bit = 0; bit < bits; ++bit)
      if (!arrived[first + bit]) missing[bit / 32] |= std::uint32_t{1} << (31 - bit % 32);
    const std::size_t words = (bits + 31) / 32;
    AppendDestination(to, ack_nack.to);
    to.insert(to.end(), {kNackFrag, kLittleEndian, static_cast<std::uint8_t>(28 + 4 * words), 0});
    Append(to, reader);
    Append(to, writer);
    Append32(to, static_cast<std::uint32_t>(at->first.second >> 32));
    Append32(to, static_cast<std::uint32_t>(at->first.second));
    Append32(to, first + 1);
    Append32(to, bits);
    for (std::size_t word = 0; word < words; ++word) Append32(to, missing[word]);
    Append32(to, ++questions_);
  }
}

FragmentAssembly::Datagram FragmentAssembly::Add(const Submessage& fragment, const Datagram& sender) {
  const auto at = SampleOf(fragment);
  Sample& sample = at->second;
  const std::size_t begin = FirstFragment(fragment) - 1, end = begin + FragmentCount(fragment);
  const std::size_t missing = sample.missing;
  for (std::size_t i = begin; i < end; ++i) {
    if (!sample.arrived[i]) --sample.missing;
    sample.arrived[i] = true;
  }
  if (sample.missing == missing) return {};  // They have arrived before.
  const std::size_t offset = begin * sample.fragment_bytes;
  const std::size_t size = std::min<std::size_t>(sample.sample_bytes, end * sample.fragment_bytes) - offset;
  const Bytes payload = fragment.body.bytes.subspan(PayloadStart(fragment, kFragmentQos), size);
  sample.pieces.push_back({offset, {payload.begin(), payload.end()}});
  std::size_t bytes = kPieceBytes + size;
  if (begin == 0 && sample.head.empty()) {
    sample.head = sender;
    AppendDataHead(sample.head, fragment);
    bytes += sample.head.size();
  }
  sample.bytes += bytes;
  bytes_ += bytes;
  Datagram whole;
  if (sample.missing == 0) {
    whole = std::move(sample.head);
    const std::size_t head = whole.size();
    whole.resize(head + sample.sample_bytes);
    for (const Piece& piece : sample.pieces)
      std::ranges::copy(piece.payload, whole.begin() + static_cast<std::ptrdiff_t>(head + piece.offset));
    Forget(at);
  }
  while (bytes_ > kMaxBytes) Forget(samples_.find(begun_.begin()->second));
  return whole;
}

// Fragments of another size belong to another sample: what came before can not become whole with them.
FragmentAssembly::Samples::iterator FragmentAssembly::SampleOf(const Submessage& fragment) {
  Key key;
  std::ranges::copy(fragment.from, key.first.begin());
  std::ranges::copy(fragment.body.bytes.subspan(8, 4), key.first.begin() + 12);
  std::ranges::copy(fragment.to, key.first.begin() + 16);
  std::ranges::copy(fragment.body.bytes.subspan(4, 4), key.first.begin() + 28);
  key.second = fragment.body.Sequence(12);
  if (const auto at = samples_.find(key); at != samples_.end()) {
    if (at->second.fragment_bytes == FragmentBytes(fragment) && at->second.sample_bytes == SampleBytes(fragment))
      return at;
    Forget(at);
  }
  Sample sample;
  sample.fragment_bytes = FragmentBytes(fragment);
  sample.sample_bytes = SampleBytes(fragment);
  sample.missing = (sample.sample_bytes + std::size_t{sample.fragment_bytes} - 1) / sample.fragment_bytes;
  sample.arrived.resize(sample.missing);
  sample.begun = ++counter_;
  sample.bytes = kSampleBytes + sample.missing / 8;
  bytes_ += sample.bytes;
  begun_.emplace(sample.begun, key);
  return samples_.emplace(key, std::move(sample)).first;
}

void FragmentAssembly::Forget(Samples::iterator sample) {
  bytes_ -= sample->second.bytes;
  begun_.erase(sample->second.begun);
  samples_.erase(sample);
}

}  // namespace cairn::wire
