#include "common/wire/rtps_submessage.h"

namespace cairn::wire {

std::size_t EndOfParameters(const SubmessageReader& body, std::size_t at) {
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

std::size_t PayloadStart(const Submessage& m, std::size_t fixed) {
  constexpr std::uint8_t kInlineQos = 0x02;
  const std::size_t qos = 4 + static_cast<std::size_t>(m.body.U16(2));
  if (qos < fixed || qos > m.size()) return 0;
  return (m.flags & kInlineQos) != 0 ? EndOfParameters(m.body, qos) : qos;
}

SequenceGate::GuidPrefix PrefixAt(std::span<const std::uint8_t> bytes, std::size_t at) {
  SequenceGate::GuidPrefix prefix;
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), prefix.size(), prefix.begin());
  return prefix;
}

}  // namespace cairn::wire
