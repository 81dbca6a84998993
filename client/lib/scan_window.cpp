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
  if (ledger.last_sequence > sent_) return;  // The ledger counts the scans of an earlier client.
  // The newest value and not the maximum: a server that was restarted without its state has settled less than before,
  // and would otherwise be sent more than the window allows.
  settled_through_ = ledger.settled_through;
  durable_through_ = ledger.durable_through;
  while (!kept_.empty() && kept_.front()->scan.sequence <= safe_through()) kept_.pop_front();
}

std::uint64_t ScanWindow::safe_through() const {
  // A server without a store never reports durable scans. After its death old scans would be of no use to it.
  return durable_through_ > 0 ? durable_through_ : settled_through_;
}

}  // namespace cairn::client
