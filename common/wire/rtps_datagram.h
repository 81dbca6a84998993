// Looks at one UDP datagram before the middleware does and says whether it is safe to hand on. Debian's Fast DDS 2.9 is
// built with asserts: some malformed datagrams abort the process, and absurd sequence numbers make it loop for minutes
// (idl/README.md). Checks the framing of RTPS 2.x submessages and their fixed parts; not the meaning, not the sender.
// Mitigation, not a cure: whoever may send to the port of a participant must be trusted not to attack it.
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
  kNotRtps,        // Header.
  kFraming,        // A submessage longer than the datagram, or shorter than its fixed part.
  kStatistics,     // eProsima's statistics submessage where its assert would fire.
  kSequence,       // A sequence number that is not possible or jumps absurdly far.
  kSequenceSet,    // More bits than a set can have, or than the submessage holds.
  kFragment,       // Fragment numbers that describe no sample, or a sample over the limit.
  kParameterList,  // A parameter longer than its list, or a list without end.
};
[[nodiscard]] std::string_view DatagramFaultName(DatagramFault fault);

// Remembers how far each remote writer's sequence numbers have come, so that absurd jumps are told from long uptimes.
// Thread-safe. Forgets everything when its table is full, which only costs the next jump of each writer its check.
class SequenceGate {
 public:
  using WriterKey = std::array<std::uint8_t, 16>;  // GUID.
  static constexpr std::int64_t kMaxJump = std::int64_t{1} << 30;
  static constexpr std::size_t kMaxWriters = 16384;

  // Accepts and remembers a sequence number of a writer, or refuses it.
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
