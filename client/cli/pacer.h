// Delays the records of a stream so that they follow each other as their stamps do, `rate` times as fast. Where a stamp
// goes back, or jumps ahead by more than `kLongestWait_s`, the record is due at once and counts as a new start.
#pragma once

#include <chrono>

#include "common/sensor/stamp.h"

namespace cairn::client {

class Pacer {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr double kLongestWait_s = 60.0;

  // `rate` <= 0: never wait.
  explicit Pacer(double rate) : rate_(rate) {}

  // When the record of this stamp is due. The first is due `now`.
  [[nodiscard]] Clock::time_point Due(Stamp stamp, Clock::time_point now);
  // Sleeps until then, or until the program is interrupted.
  void WaitFor(Stamp stamp);

 private:
  const double rate_;
  bool started_ = false;
  Stamp base_stamp_ = 0;
  Clock::time_point base_time_;
};

}  // namespace cairn::client
