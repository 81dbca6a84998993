// Reports values that are lost between DDS and the server's rooms, as text for the log and for the status
// that the service manager shows. There is a line when losses begin, and then at most one every kPeriod while
// they continue; each line counts the losses since the previous line. Scans that are lost within a session
// are counted in its ledgers. The counters here also include losses that no ledger counts. Not thread-safe:
// one owner.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace cairn::server {

// Counts since the start of the server. They never decrease.
struct DoorCounts {
  std::uint64_t inbound_full = 0;     // Values from DDS dropped because the inbound channel was full.
  std::uint64_t malformed = 0;        // Samples from DDS with lengths or enums out of range.
  std::uint64_t uncounted_scans = 0;  // Scans of streams without a session, beyond robots.max_unclaimed streams.
  std::uint64_t outbound_full = 0;    // Values for DDS dropped because their outbound lane was full.
  std::uint64_t unpublished = 0;      // Values that DDS did not accept in time.

  bool operator==(const DoorCounts&) const = default;
};

// For example "3 received (inbound channel full), 1 malformed". Counts of 0 are left out; "nothing" if all
// are 0.
[[nodiscard]] std::string TextOf(const DoorCounts& counts);

class DoorLosses {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr auto kPeriod = std::chrono::seconds(10);

  // The log line that is due at `now`, if any.
  [[nodiscard]] std::optional<std::string> Check(const DoorCounts& counts, Clock::time_point now);

 private:
  DoorCounts told_;  // The counts that the last line reported.
  std::optional<Clock::time_point> told_at_;
};

}  // namespace cairn::server
