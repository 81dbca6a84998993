// Numbers the samples of a stream of ROS 2, which has no numbers of its own: 1, 2, 3, ... in the order of arrival.
// Where the middleware's own numbers of the same writer have a gap, the stream gets the same gap, so that the ledger
// counts what was lost on the wire. Plain value.
#pragma once

#include <cstdint>

#include "common/wire/ros2/bus.h"

namespace cairn::ros2 {

class SampleNumbers {
 public:
  // A larger gap is no loss: the writer began anew, or wrote while nobody listened.
  static constexpr std::int64_t kMaxGap = 10'000;

  [[nodiscard]] std::uint64_t Next(const Origin& origin) {
    const std::int64_t ahead = origin.sequence - last_.sequence;
    const bool gap = last_.writer == origin.writer && ahead > 1 && ahead <= kMaxGap;
    number_ += gap ? static_cast<std::uint64_t>(ahead) : 1U;
    last_ = origin;
    return number_;
  }
  // From 1 again: a new session.
  void Restart() { *this = {}; }

 private:
  Origin last_;
  std::uint64_t number_ = 0;
};

}  // namespace cairn::ros2
