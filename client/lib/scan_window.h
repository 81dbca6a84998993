// Numbers the samples of one stream (robot, sensor) of a session, and tells whether the next sample must wait until the
// server has settled earlier ones. Does no I/O and uses no clock. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/service/ledger.h"

namespace cairn::client {

class ScanWindow {
 public:
  // `window`: the largest number of samples that are sent and not yet settled; 0: no limit. It must stay below 64, the
  // depth of the writer's history.
  explicit ScanWindow(std::uint64_t window) : window_(window) {}

  // Whether another sample may be sent now. Those up to `gone` can not be sent any more, so nobody waits for them.
  [[nodiscard]] bool HasRoom(std::uint64_t gone = 0) const {
    return window_ == 0 || sent_ < std::max(settled_through_, gone) + window_;
  }
  // The number of the next sample: 1, 2, 3, ...
  [[nodiscard]] std::uint64_t Next() { return ++sent_; }
  // Makes the last number free again.
  void TakeBack() { --sent_; }
  // The newest ledger counts, not the highest one: a server that was restarted without its state has settled less than
  // before, and must not be sent more than the window allows.
  void OnLedger(const Ledger& ledger) { settled_through_ = ledger.settled_through; }
  // Begins a new session in which the numbers up to `sent` are already used.
  void Restart(std::uint64_t sent) {
    sent_ = sent;
    settled_through_ = 0;
  }

  [[nodiscard]] std::uint64_t sent() const { return sent_; }  // Highest number given.
  [[nodiscard]] std::uint64_t settled_through() const { return settled_through_; }
  [[nodiscard]] bool settled() const { return settled_through_ >= sent_; }

 private:
  const std::uint64_t window_;
  std::uint64_t sent_ = 0;
  std::uint64_t settled_through_ = 0;
};

}  // namespace cairn::client
