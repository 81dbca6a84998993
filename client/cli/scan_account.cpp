#include "client/cli/scan_account.h"

#include <fmt/format.h>

#include <numeric>

namespace cairn::client {

void ScanAccount::Add(const ScanAccount& other) {
  sent += other.sent;
  used += other.used;
  keyframes += other.keyframes;
  waiting += other.waiting;
  for (std::size_t i = 0; i < dropped.size(); ++i) dropped[i] += other.dropped[i];
}

std::uint64_t ScanAccount::dropped_total() const {
  return std::accumulate(dropped.begin(), dropped.end(), std::uint64_t{0});
}

std::int64_t ScanAccount::unexplained() const {
  return static_cast<std::int64_t>(sent) - static_cast<std::int64_t>(used + waiting + dropped_total());
}

ScanAccount AccountScans(std::uint64_t sent, const Ledger& before, const Ledger& after) {
  // A server that lost its state counts from zero again: then there is nothing to subtract.
  const Ledger base = after.received >= before.received ? before : Ledger{};
  ScanAccount account;
  account.sent = sent;
  account.used = after.used - base.used;
  account.keyframes = after.keyframes - base.keyframes;
  account.waiting = after.waiting;
  for (std::size_t i = 0; i < account.dropped.size(); ++i) account.dropped[i] = after.dropped[i] - base.dropped[i];
  return account;
}

std::string FormatAccount(const ScanAccount& account) {
  std::string reasons;
  for (int i = 0; i < kDropReasonCount; ++i) {
    const std::uint64_t count = account.dropped[static_cast<std::size_t>(i)];
    if (count == 0) continue;
    reasons += fmt::format("{}{} {}", reasons.empty() ? " (" : ", ", DropReasonName(static_cast<DropReason>(i)), count);
  }
  if (!reasons.empty()) reasons += ")";
  return fmt::format("sent {}, used {} ({} keyframes), dropped {}{}, waiting {}, unexplained {}", account.sent,
                     account.used, account.keyframes, account.dropped_total(), reasons, account.waiting,
                     account.unexplained());
}

}  // namespace cairn::client
