// Puts samples together that arrive in fragments (DATA_FRAG), so that the middleware receives each of them whole, as
// DATA. Fast DDS 2.9 does not handle fragments safely. It keeps a pointer to the first ones of a sample when a gap then
// says that there is no such sample: readers deliver leftovers, or abort. It writes beyond a sample whose last fragment
// has less than four bytes (tests/integration/wire/hostile_datagram_test.cpp).
// A reader that has received nothing of a sample asks for all of it again (ACKNACK), so a lost fragment costs all
// others. To some writers that is not enough: Cyclone DDS sends the first fragment again, and waits to be asked for the
// others. The memory is bounded: samples that were begun first are forgotten first. Not thread-safe. Source: OMG
// DDSI-RTPS 2.3, sections 8.3.7.3 and 9.4.5.4; Fast DDS 2.9.1: StatefulReader.cpp, CacheChange.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "common/wire/rtps_submessage.h"

namespace cairn::wire {

[[nodiscard]] bool HasFragments(std::span<const std::uint8_t> datagram);
// Fragments of what a built-in endpoint sends or receives. Cyclone DDS sends the type of an endpoint in them.
[[nodiscard]] bool HasBuiltInFragments(std::span<const std::uint8_t> datagram);

class FragmentAssembly {
 public:
  using Datagram = std::vector<std::uint8_t>;
  static constexpr std::size_t kMaxBytes = std::size_t{4} << 20;  // 16 of the largest samples.

  // What is to be delivered instead of the datagram: each sample that is whole now, and then the other submessages.
  // REQUIRES: InspectDatagram finds no fault in it.
  [[nodiscard]] std::vector<Datagram> Take(std::span<const std::uint8_t> datagram);
  // What is to be sent instead of the participant's own datagram: if it asks for samples of which some fragments are
  // here, the same with questions for the other fragments (NACK_FRAG). Empty if there is nothing to ask for.
  [[nodiscard]] Datagram WithQuestions(std::span<const std::uint8_t> datagram);
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  // GUIDs of writer and reader as the fragment names them, and the sequence number.
  using Key = std::pair<std::array<std::uint8_t, 32>, std::int64_t>;
  struct Piece {
    std::size_t offset = 0;
    std::vector<std::uint8_t> payload;
  };
  struct Sample {
    std::uint16_t fragment_bytes = 0;
    std::uint32_t sample_bytes = 0;
    std::vector<bool> arrived;  // By fragment.
    std::size_t missing = 0;
    std::uint64_t begun = 0;
    std::size_t bytes = 0;  // Of memory.
    Datagram head;          // All of the whole sample's datagram but the payload; comes with the first fragment.
    std::vector<Piece> pieces;
  };
  using Samples = std::map<Key, Sample>;

  // Returns the datagram of the sample if it is whole now, otherwise nothing. `sender`: the header and what the
  // datagram says about its sender, its receiver and its time before the fragment.
  [[nodiscard]] Datagram Add(const Submessage& fragment, const Datagram& sender);
  [[nodiscard]] Samples::iterator SampleOf(const Submessage& fragment);
  void Forget(Samples::iterator sample);
  // Appends the questions for what is missing of the writer's samples that the ACKNACK asks for.
  void AppendQuestions(Datagram& to, const Submessage& ack_nack);

  Samples samples_;
  std::map<std::uint64_t, Key> begun_;  // The same samples, the oldest first.
  std::uint64_t counter_ = 0;
  std::uint32_t questions_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace cairn::wire
