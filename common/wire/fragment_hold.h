// Holds datagrams with fragments of samples back until all fragments of a sample have arrived. Fast DDS 2.9 would store
// the first ones, and keeps a pointer to them when a gap then says that there is no such sample: readers deliver
// leftovers, or abort (tests/integration/wire/hostile_datagram_test.cpp). A reader that has seen no fragment asks for
// the whole sample again, so a lost fragment costs all others of its sample.
// What is held is bounded: the samples that were begun first are forgotten first. Not thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace cairn::wire {

// Fragments of one sample in one datagram.
struct FragmentRange {
  // The sample: GUID of the writer, entity of the reader (0: every reader), and sequence number.
  using Key = std::pair<std::array<std::uint8_t, 20>, std::int64_t>;
  Key sample;
  std::uint32_t first = 1;  // Counted from 1.
  std::uint32_t count = 1;
  std::uint32_t fragment_bytes = 1;
  std::uint32_t sample_bytes = 1;
};

class FragmentHold {
 public:
  using Datagram = std::vector<std::uint8_t>;
  static constexpr std::size_t kMaxBytes = std::size_t{4} << 20;  // 16 of the largest samples.

  // Takes a datagram and what it has of samples. Returns all that is to be delivered now, in the order of arrival.
  // REQUIRES: the ranges lie within their samples (InspectDatagram).
  [[nodiscard]] std::vector<Datagram> Add(std::span<const std::uint8_t> datagram,
                                          std::span<const FragmentRange> fragments);
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  struct Held {
    Datagram bytes;
    std::uint64_t number = 0;  // Counts datagrams.
    int waits_for = 0;         // Samples that are not complete.
  };
  struct Sample {
    std::uint32_t fragment_bytes = 0;
    std::uint32_t sample_bytes = 0;
    std::vector<bool> arrived;
    std::size_t missing = 0;
    std::uint64_t begun = 0;
    std::size_t bytes = 0;
    std::vector<std::shared_ptr<Held>> datagrams;
  };
  using Samples = std::map<FragmentRange::Key, Sample>;

  [[nodiscard]] Samples::iterator SampleOf(const FragmentRange& range);
  void Forget(Samples::iterator sample);
  void MakeRoom();

  Samples samples_;
  std::deque<std::pair<std::uint64_t, FragmentRange::Key>> begun_;  // Also of samples that are gone.
  std::uint64_t counter_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace cairn::wire
