// The guard in front of the middleware: pieces, each a datagram of the same traffic. What it lets through is read here
// as a receiver of RTPS 2.3 reads it (8.3.4, 9.4.5), with a check at every step that the middleware does not make.
#include <algorithm>
#include <limits>
#include <span>

#include "common/wire/fragment_assembly.h"
#include "common/wire/limits.h"
#include "common/wire/rtps_datagram.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/guard_seeds.h"

namespace cairn::fuzz {
namespace {

// Reads numbers that must be inside the submessage.
class Body {
 public:
  Body(std::string_view bytes, bool little) : bytes_(bytes), little_(little) {}

  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  std::uint64_t Number(std::size_t at, std::size_t width) const {
    Must(at + width <= bytes_.size(), "what a receiver reads is inside the submessage");
    std::uint64_t number = 0;
    for (std::size_t i = 0; i < width; ++i)
      number = number << 8 | static_cast<std::uint8_t>(bytes_[at + (little_ ? width - 1 - i : i)]);
    return number;
  }
  [[nodiscard]] std::string_view Bytes(std::size_t at, std::size_t size) const { return bytes_.substr(at, size); }
  // DDS Security: whatever the submessage's own byte order is.
  [[nodiscard]] std::uint64_t BigEndian(std::size_t at) const { return Body(bytes_, false).Number(at, 4); }
  [[nodiscard]] std::int64_t Sequence(std::size_t at) const {
    return static_cast<std::int64_t>(Number(at, 4) << 32 | Number(at + 4, 4));
  }

 private:
  std::string_view bytes_;
  bool little_;
};

// More than the numbers of a peer may skip while one input is read.
constexpr std::int64_t kLongestSkip = std::int64_t{1} << 30;

void MustBePlausible(std::int64_t sequence) {
  Must(sequence >= 0 && sequence <= wire::SequenceGate::kMaxFirst + kLongestSkip,
       "the first numbers of a writer are plausible");
}

std::size_t AfterParameters(const Body& body, std::size_t at) {
  for (;;) {
    const std::uint64_t id = body.Number(at, 2), length = body.Number(at + 2, 2);
    at += 4;
    if (id == 1) return at;
    if (id == 0x70) Must(length == 16, "a key hash has 16 bytes");
    if (length > 0) body.Number(at + length - 1, 1);
    at += length;
  }
}

void ReadSet(const Body& body, std::size_t at) {
  const std::uint64_t bits = body.Number(at, 4);
  Must(bits <= 256, "a set has at most 256 bits");
  for (std::size_t word = 0; word < (bits + 31) / 32; ++word) body.Number(at + 4 + 4 * word, 4);
}

void ReadData(const Body& body, std::uint8_t flags, bool fragment) {
  MustBePlausible(body.Sequence(12));
  std::size_t payload = 4 + body.Number(2, 2);
  if ((flags & 2) != 0) payload = AfterParameters(body, payload);
  Must(payload <= body.size(), "the payload begins inside the submessage");
  if (!fragment) return;
  const std::uint64_t first = body.Number(20, 4), count = body.Number(24, 2), bytes = body.Number(26, 2);
  const std::uint64_t sample = body.Number(28, 4);
  Must(sample <= wire::kMaxSampleBytes && first > 0 && bytes > 0, "fragments are of a sample within the limit");
  const std::uint64_t begin = (first - 1) * bytes, end = std::min(begin + count * bytes, sample);
  Must(begin < end && end - begin <= body.size() - payload, "the fragments are inside the submessage and the sample");
}

// The last sample that the participant has sent by the writer whose id stands there.
std::int64_t LastOf(const Body& body, std::size_t at) {
  return body.Bytes(at, 4) == std::string_view("\0\0\0\2", 4) ? kOwnLast : 0;  // kSeedWriter.
}

void ReadSubmessage(std::uint8_t id, std::uint8_t flags, const Body& body, bool to_own) {
  switch (id) {
    case 0x06:  // ACKNACK
      Must(body.Sequence(8) >= 0, "a base is no negative number");
      Must(!to_own || body.Sequence(8) <= LastOf(body, 4) + 1, "nothing is acknowledged that was never sent");
      return ReadSet(body, 16);
    case 0x07:  // HEARTBEAT
      MustBePlausible(body.Sequence(8));
      MustBePlausible(body.Sequence(16) + 1);
      return static_cast<void>(body.Number(24, 4));
    case 0x08: {  // GAP
      const std::int64_t first = body.Sequence(8), base = body.Sequence(16);
      Must(first > 0 && base >= first, "a gap ends after its beginning");
      MustBePlausible(base);
      return ReadSet(body, 24);
    }
    case 0x12:  // NACK_FRAG
      Must(!to_own || body.Sequence(8) <= LastOf(body, 4), "no fragment is asked for that was never sent");
      return ReadSet(body, 20);
    case 0x13:  // HEARTBEAT_FRAG
      return static_cast<void>(body.Number(20, 4));
    case 0x15:  // DATA
      return ReadData(body, flags, false);
    case 0x16:  // DATA_FRAG
      return ReadData(body, flags, true);
    case 0x30:  // SEC_BODY
      return Must(body.BigEndian(0) <= body.size() - 4, "a ciphertext is inside the submessage");
    case 0x31:  // SEC_PREFIX
    case 0x33:  // SRTPS_PREFIX
      return Must(body.size() == 20, "the header of what is protected has 20 bytes");
    case 0x32:  // SEC_POSTFIX
    case 0x34:  // SRTPS_POSTFIX
      return Must(body.BigEndian(16) <= (body.size() - 20) / 20,
                  "the codes of all receivers are inside the submessage");
    default:
      return;
  }
}

// How Fast DDS 2.9 reads a datagram that is signed as a whole, before it has looked at the signature.
void ReadAsSigned(std::string_view datagram) {
  if (datagram.size() <= 20 || static_cast<std::uint8_t>(datagram[20]) != 0x33) return;
  std::size_t at = 20;
  while (static_cast<std::uint8_t>(datagram[at]) != 0x34) {
    Must(at + 4 <= datagram.size(), "a submessage of what is signed has a header");
    const bool little = (static_cast<std::uint8_t>(datagram[at + 1]) & 1) != 0;
    at += 4 + (Body(datagram, little).Number(at + 2, 2) + 3) / 4 * 4;
    Must(at < datagram.size(), "what is signed ends with its signature");
  }
  const Body signature(datagram.substr(std::min(at + 4, datagram.size())), false);
  Must(signature.size() >= 20 && signature.BigEndian(16) <= (signature.size() - 20) / 20,
       "the codes of all receivers are inside the datagram");
}

void ReadAsReceiver(std::string_view datagram) {
  ReadAsSigned(datagram);
  bool to_own = true;  // To everybody.
  std::size_t at = 20;
  while (at < datagram.size()) {
    const auto id = static_cast<std::uint8_t>(datagram[at]), flags = static_cast<std::uint8_t>(datagram[at + 1]);
    std::size_t length = Body(datagram, (flags & 1) != 0).Number(at + 2, 2);
    if (length == 0 && id != 0x01 && id != 0x09) length = datagram.size() - at - 4;
    Must(length <= datagram.size() - at - 4, "a submessage ends inside the datagram");
    Must(id != 0x80 || at + 4 + length == datagram.size(), "statistics are the last submessage");
    const std::string_view content = datagram.substr(at + 4, length);
    ReadSubmessage(id, flags, {content, (flags & 1) != 0}, to_own);
    if (id == 0x0e) to_own = content.substr(0, 12) == kOwnPrefix || content.substr(0, 12) == std::string(12, '\0');
    at += 4 + (length + 3) / 4 * 4;  // As Fast DDS 2.9 does.
  }
}

bool RunGuard(std::string_view input) {
  wire::SequenceGate gate;
  wire::NoteSent(OwnDatagram().bytes(), gate);
  wire::FragmentAssembly assembly;
  bool accepted = false;
  for (Pieces pieces(input); !pieces.empty();) {
    const std::string_view received = pieces.TakePiece();
    const std::vector<std::uint8_t> bytes(received.begin(), received.end());  // Exactly as long as the piece.
    const auto kept = wire::WithoutStatistics(bytes);
    const std::string_view piece = received.substr(0, kept.size());
    const std::vector<std::uint8_t> datagram(kept.begin(), kept.end());
    const wire::DatagramFault fault = wire::InspectDatagram(datagram, gate);
    Must(!wire::DatagramFaultName(fault).empty(), "a fault has a name");
    if (fault != wire::DatagramFault::kNone) continue;
    accepted = true;
    Must(wire::InspectDatagram(datagram, gate) == wire::DatagramFault::kNone, "a repeated datagram is accepted again");
    ReadAsReceiver(piece);
    if (const auto counted = wire::WithOwnCounts(datagram, gate); !counted.empty()) {
      Must(counted.size() == datagram.size(), "only counts are changed");
      Must(wire::InspectDatagram(counted, gate) == wire::DatagramFault::kNone, "a changed datagram is accepted");
    }
    static_cast<void>(assembly.WithQuestions(datagram));
    if (!wire::HasFragments(datagram)) continue;
    for (const auto& whole : assembly.Take(datagram)) {
      Must(!wire::HasFragments(whole), "fragments do not reach the middleware");
      if (wire::InspectDatagram(whole, gate) == wire::DatagramFault::kNone)
        ReadAsReceiver(std::string(whole.begin(), whole.end()));
    }
    Must(assembly.bytes() <= wire::FragmentAssembly::kMaxBytes, "what waits is bounded");
  }
  return accepted;
}

using Numbers = std::vector<std::uint8_t>;

Numbers Sequence(std::uint8_t number) {
  return {0, 0, 0, 0, number, 0, 0, 0};
}

std::string Submessage(std::uint8_t id, std::uint8_t flags, std::initializer_list<Numbers> parts) {
  std::string body;
  for (const Numbers& part : parts) body.append(part.begin(), part.end());
  std::string bytes = {static_cast<char>(id), static_cast<char>(flags | 1), static_cast<char>(body.size()), 0};
  return bytes + body;
}

std::string Message(const std::string& submessages) {
  return std::string("RTPS\x02\x03\x01\x0f", 8) + std::string("prefix of id") + submessages;
}

std::vector<std::string> SeedsOfDatagrams() {
  const Numbers nobody(4, 0), writer = {0, 0, 0, 2}, discovery = {0, 0, 3, 0xc2}, words(8, 0xff), one = {1, 0, 0, 0};
  const Numbers end_of_list = {1, 0, 0, 0}, key_hash = {0x70, 0, 16, 0}, plain = {0, 1, 0, 0}, list = {0, 3, 0, 0};
  const Numbers no_flags_and_16 = {0, 0, 16, 0}, no_flags_and_28 = {0, 0, 28, 0}, sixteen(16, 7);
  const std::vector<std::string> submessages = {
      Submessage(0x06, 0, {nobody, writer, Sequence(1), {33, 0, 0, 0}, words, one}),
      Submessage(0x07, 0, {nobody, writer, Sequence(1), Sequence(9), one}),
      Submessage(0x08, 0, {nobody, writer, Sequence(1), Sequence(9), {64, 0, 0, 0}, words}),
      Submessage(0x09, 0, {Numbers(8, 1)}),
      Submessage(0x0c, 0, {Numbers(20, 3)}),
      Submessage(0x0e, 0, {Numbers(12, 4)}),
      Submessage(0x12, 0, {nobody, writer, Sequence(1), one, {33, 0, 0, 0}, words, one}),
      Submessage(0x13, 0, {nobody, writer, Sequence(1), one, one}),
      Submessage(0x15, 4, {no_flags_and_16, nobody, writer, Sequence(5), plain, sixteen}),
      Submessage(0x15, 6, {no_flags_and_16, nobody, writer, Sequence(6), key_hash, sixteen, end_of_list, plain}),
      Submessage(0x15, 4, {no_flags_and_16, nobody, discovery, Sequence(2), list, {5, 0, 4, 0}, one, end_of_list}),
      Submessage(0x16, 0, {no_flags_and_28, nobody, writer, Sequence(7), one, {2, 0, 8, 0}, {16, 0, 0, 0}, sixteen}),
      Submessage(0x80, 0, {Numbers(56, 0)})};
  std::vector<std::string> seeds;
  std::string all, traffic;
  for (const std::string& one_of_them : submessages) {
    seeds.push_back(Piece(Message(one_of_them)));
    all += one_of_them;
    traffic += seeds.back();
  }
  seeds.push_back(Piece(Message(all)));
  seeds.push_back(traffic);
  for (const Datagram& secure : SecureDatagrams()) seeds.push_back(DatagramPiece(secure));
  for (const auto& conversation : Conversations()) {
    seeds.emplace_back();
    for (const Datagram& datagram : conversation) seeds.back() += DatagramPiece(datagram);
  }
  return seeds;
}

const bool kGuardTarget = Register({"guard", &RunGuard, &SeedsOfDatagrams});

}  // namespace
}  // namespace cairn::fuzz
