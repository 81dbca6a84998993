// Builds RTPS datagrams for tests of the guard.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/wire/rtps_datagram.h"

namespace cairn::wire::test {

using Bytes = std::vector<std::uint8_t>;

inline constexpr std::uint8_t kLittleEndian = 0x01;
inline constexpr std::uint8_t kInlineQos = 0x02;
inline constexpr std::uint8_t kHasData = 0x04;

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
  Datagram& Byte(std::uint8_t v) { return Put(v, 1); }
  Datagram& U16(std::uint16_t v) { return Put(v, 2); }
  Datagram& U32(std::uint32_t v) { return Put(v, 4); }
  Datagram& Sequence(std::int64_t v) {
    return U32(static_cast<std::uint32_t>(static_cast<std::uint64_t>(v) >> 32)).U32(static_cast<std::uint32_t>(v));
  }
  Datagram& Zeros(std::size_t n) {
    bytes_.resize(bytes_.size() + n);
    return *this;
  }
  Datagram& BigEndian(std::uint32_t v) { return Put(__builtin_bswap32(v), 4); }
  // A string or a vector of octets, and zeros that align what follows.
  Datagram& Text(const std::string& text) {
    U32(static_cast<std::uint32_t>(text.size()));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    return Zeros((4 - text.size() % 4) % 4);
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

inline Datagram Data(std::uint8_t flags, std::int64_t sequence) {
  Datagram datagram;
  datagram.Begin(0x15, flags).U16(0).U16(16).U32(0).U32(0x02000000).Sequence(sequence);
  return datagram;
}

}  // namespace cairn::wire::test
