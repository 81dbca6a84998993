// Checks one UDP datagram and decides whether it is safe to pass to the middleware. Debian's Fast DDS 2.9 is
// built with asserts: some malformed datagrams abort the process, and sequence numbers that are far too large
// make it loop for minutes (idl/README.md). The check covers the framing of RTPS 2.x submessages and their
// fixed parts, but neither their meaning nor their sender. It reduces the risk but does not remove it: every
// machine that can send to a participant's port must be trusted.
// Source: OMG DDSI-RTPS 2.3, sections 8.3 and 9.4.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <unordered_map>

#include "common/mutex.h"

namespace cairn::wire {

enum class DatagramFault : std::uint8_t {
  kNone = 0,
  kNotRtps,        // The header is not that of RTPS 2.
  kFraming,        // A submessage longer than the datagram, or shorter than its fixed part.
  kStatistics,     // A statistics submessage of eProsima that would trigger an assert.
  kSequence,       // A sequence number that is impossible or far ahead of the previous one.
  kSequenceSet,    // More bits than a set can have, or than the submessage holds.
  kFragment,       // Fragment numbers that describe no sample, or a sample over the limit.
  kParameterList,  // A parameter longer than its list, or a list without end.
};
[[nodiscard]] std::string_view DatagramFaultName(DatagramFault fault);

// Stores the highest sequence number of each remote writer, to tell jumps that are too large from the large
// numbers of writers that have run for long. When its table is full, it forgets all writers; then only the
// next number of each writer is not compared. Thread-safe.
class SequenceGate {
 public:
  using WriterKey = std::array<std::uint8_t, 16>;  // GUID.
  static constexpr std::int64_t kMaxJump = std::int64_t{1} << 30;
  static constexpr std::size_t kMaxWriters = 16384;

  // Accepts and stores a sequence number of a writer, or refuses it.
  [[nodiscard]] bool Accept(const WriterKey& writer, std::int64_t sequence);

 private:
  struct Hash {
    std::size_t operator()(const WriterKey& key) const;
  };
  Mutex mutex_;
  std::unordered_map<WriterKey, std::int64_t, Hash> highest_ CAIRN_GUARDED_BY(mutex_);
};

[[nodiscard]] DatagramFault InspectDatagram(std::span<const std::uint8_t> datagram, SequenceGate& gate);

}  // namespace cairn::wire
