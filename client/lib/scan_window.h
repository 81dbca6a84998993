// The numbers of one stream (robot, sensor) of a session: the next one to give, how far the server has come, and
// whether the next sample must wait. Pure bookkeeping: no wire, no clock. Not thread-safe.
#pragma once

#include <cstdint>

#include "common/service/ledger.h"

namespace cairn::client {

class ScanWindow {
 public:
  // `window`: the largest number of samples that are sent and not yet settled; 0: no limit. It must stay below 64, the
  // depth of the writer's history.
  explicit ScanWindow(std::uint64_t window) : window_(window) {}

  // Whether another sample may be sent now.
  [[nodiscard]] bool HasRoom() const { return window_ == 0 || sent_ < settled_through_ + window_; }
  // The number of the next sample: 1, 2, 3, ...
  [[nodiscard]] std::uint64_t Next() { return ++sent_; }
  // The last number is given back.
  void TakeBack() { --sent_; }
  // The newest ledger counts, and not the highest: a server that was restarted without its state has settled less than
  // before, and would otherwise be sent more than the window allows.
  void OnLedger(const Ledger& ledger) { settled_through_ = ledger.settled_through; }
  // A new session, in which `sent` numbers are given already.
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
