// The scans of one stream (robot, sensor) that the server may still need again: those it has not settled, and, where it
// has a store, those it has not made durable. Numbers the scans, says when the next one must wait, and what to send
// again after a reconnection. Pure bookkeeping: no wire, no clock. Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "common/service/ledger.h"
#include "common/service/stream.h"

namespace cairn::client {

struct ScanWindowOptions {
  // The largest number of scans that are sent and not yet settled; 0: no limit. It must stay below 64, the depth of the
  // writer's history.
  std::uint64_t window = 32;
  // Scans kept for sending them again. More bridge a longer outage of the server, and need more memory.
  std::size_t kept_scans = 1024;
};

class ScanWindow {
 public:
  using Kept = std::shared_ptr<const ScanSample>;

  explicit ScanWindow(const ScanWindowOptions& options) : options_(options) {}

  // Whether another scan may be sent now.
  [[nodiscard]] bool HasRoom() const;
  // Numbers the scan where it has no number, and keeps it until OnLedger says it is safe.
  Kept Add(ScanSample&& sample);
  void OnLedger(const Ledger& ledger);

  // All kept, oldest first. What the server already has, it ignores.
  [[nodiscard]] std::vector<Kept> kept() const { return {kept_.begin(), kept_.end()}; }
  [[nodiscard]] std::uint64_t sent() const { return sent_; }  // Highest number given.
  [[nodiscard]] std::uint64_t settled_through() const { return settled_through_; }
  [[nodiscard]] bool settled() const { return settled_through_ >= sent_; }
  // Scans given up before they were safe: kept_scans was too small for the outage.
  [[nodiscard]] std::uint64_t forgotten() const { return forgotten_; }

 private:
  [[nodiscard]] std::uint64_t safe_through() const;

  const ScanWindowOptions options_;
  std::deque<Kept> kept_;
  std::uint64_t sent_ = 0;
  std::uint64_t settled_through_ = 0;
  std::uint64_t durable_through_ = 0;
  std::uint64_t forgotten_ = 0;
};

}  // namespace cairn::client
