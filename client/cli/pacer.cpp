#include "client/cli/pacer.h"

#include "client/cli/interrupt.h"

namespace cairn::client {

Pacer::Clock::time_point Pacer::Due(Stamp stamp, Clock::time_point now) {
  if (rate_ <= 0.0) return now;
  const auto at = [&] {
    const double seconds = SecondsFromStamp(stamp - base_stamp_) / rate_;
    return base_time_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  };
  const bool jumps =
      started_ && (stamp < base_stamp_ || std::chrono::duration<double>(at() - now).count() > kLongestWait_s);
  if (!started_ || jumps) {
    started_ = true;
    base_stamp_ = stamp;
    base_time_ = now;
  }
  return at();
}

void Pacer::WaitFor(Stamp stamp) {
  WaitUntil(Due(stamp, Clock::now()));
}

}  // namespace cairn::client
