// Accounts for the scans that a client sent, by the server's ledger. A ledger counts a stream from its beginning, so
// the ledger before the first scan is subtracted. Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "common/service/ledger.h"

namespace cairn::client {

struct ScanAccount {
  std::uint64_t sent = 0;
  std::uint64_t used = 0;
  std::uint64_t keyframes = 0;
  std::uint64_t waiting = 0;
  std::array<std::uint64_t, kDropReasonCount> dropped{};

  // Adds what another account says became of scans; `sent` too.
  void Add(const ScanAccount& other);
  [[nodiscard]] std::uint64_t dropped_total() const;
  // Sent scans that are neither used nor dropped nor waiting; negative if the server counts more than were sent.
  [[nodiscard]] std::int64_t unexplained() const;
};

[[nodiscard]] ScanAccount AccountScans(std::uint64_t sent, const Ledger& before, const Ledger& after);

// "sent 1988, used 1980 (812 keyframes), dropped 8 (no_odometry 8), waiting 0, unexplained 0".
[[nodiscard]] std::string FormatAccount(const ScanAccount& account);

}  // namespace cairn::client
