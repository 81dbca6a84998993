// Checks one UDP datagram and decides whether it is safe to pass to the middleware. Debian's Fast DDS 2.9 is
// built with asserts: some malformed datagrams abort the process, and sequence numbers that are far too large
// make it loop for minutes (idl/README.md). The check covers the framing of RTPS 2.x submessages and their
// fixed parts, but neither their meaning nor their sender. It reduces the risk but does not remove it: every
// machine that can send to a participant's port must be trusted.
// Source: OMG DDSI-RTPS 2.3, sections 8.3 and 9.4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "common/wire/sequence_gate.h"

namespace cairn::wire {

enum class DatagramFault : std::uint8_t {
  kNone = 0,
  kNotRtps,        // The header is not that of RTPS 2.
  kFraming,        // A submessage longer than the datagram, shorter than its fixed part, or not a multiple of 4 bytes.
  kStatistics,     // A statistics submessage of eProsima that would trigger an assert.
  kSequence,       // A sequence number that is impossible or far ahead of the previous one.
  kUnsent,         // An acknowledgement of samples that were never sent, or a request for them.
  kSequenceSet,    // More bits than a set can have, or than the submessage holds.
  kFragment,       // Fragment numbers that describe no sample, or a sample over the limit.
  kParameterList,  // A parameter longer than its list, or a list without end.
  kSecurity,       // A part of DDS Security whose counts or lengths exceed it (secure_datagram.h).
};
inline constexpr std::size_t kDatagramFaults = 10;
// A gap may leave out this many numbers that its writer has not reached yet. The library looks up every one of them
// with its reader locked, and a forged gap of almost a million kept a reader busy for more than two minutes. What the
// writer has reached may be left out in any number: a writer that keeps one sample for each key leaves out all between
// the last sample of a key that has not changed for hours and the next one that it keeps.
inline constexpr std::int64_t kMaxGap = 16'384;
[[nodiscard]] std::string_view DatagramFaultName(DatagramFault fault);

// The datagram without a statistics submessage of eProsima at its end, of which nothing is needed. Fast DDS 2.9 adds
// one to each datagram that it sends, also where it then has 65,504 bytes: its receivers take 65,500, so that the
// submessage is cut off there. Nothing is changed where other submessages follow.
[[nodiscard]] std::span<const std::uint8_t> WithoutStatistics(std::span<const std::uint8_t> datagram);

// A datagram that arrived at `now`. The gate keeps what must be known of the ones before.
[[nodiscard]] DatagramFault InspectDatagram(std::span<const std::uint8_t> datagram, SequenceGate& gate,
                                            SequenceGate::Clock::time_point now = SequenceGate::Clock::now());
// The datagram with counts of the gate in its heartbeats and acknowledgements; empty if it has none of these. Receivers
// ignore a heartbeat or an acknowledgement whose count is not above the one before, so a forged count could stop a
// stream. Nothing depends on the senders' own counts: what is received twice is harmless.
// Of datagrams that DDS Security has signed, which nobody can forge, nothing may be changed: empty as well.
// REQUIRES: InspectDatagram finds no fault in it.
[[nodiscard]] std::vector<std::uint8_t> WithOwnCounts(std::span<const std::uint8_t> datagram, SequenceGate& gate);
// A datagram that the participant itself sends: tells the gate its numbers.
void NoteSent(std::span<const std::uint8_t> datagram, SequenceGate& gate);

}  // namespace cairn::wire
