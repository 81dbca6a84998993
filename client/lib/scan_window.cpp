#include "client/lib/scan_window.h"

#include <algorithm>
#include <utility>

namespace cairn::client {

bool ScanWindow::HasRoom() const {
  return options_.window == 0 || sent_ < settled_through_ + options_.window;
}

ScanWindow::Kept ScanWindow::Add(ScanSample&& sample) {
  if (sample.scan.sequence == 0) sample.scan.sequence = sent_ + 1;
  sent_ = std::max(sent_, sample.scan.sequence);
  Kept kept = std::make_shared<const ScanSample>(std::move(sample));
  kept_.push_back(kept);
  if (kept_.size() > options_.kept_scans) {
    if (kept_.front()->scan.sequence > settled_through_) ++forgotten_;
    kept_.pop_front();
  }
  return kept;
}

void ScanWindow::OnLedger(const Ledger& ledger) {
  if (ledger.last_sequence > sent_) return;  // Of an earlier client of this robot; its numbers say nothing of ours.
  // Not the maximum: a server that lost its memory settles less than before, and must not be overrun on its
  // predecessor's word.
  settled_through_ = ledger.settled_through;
  durable_through_ = ledger.durable_through;
  while (!kept_.empty() && kept_.front()->scan.sequence <= safe_through()) kept_.pop_front();
}

std::uint64_t ScanWindow::safe_through() const {
  // A server without a store never says durable, and after its death would have nothing to add old scans to.
  return durable_through_ > 0 ? durable_through_ : settled_through_;
}

}  // namespace cairn::client
