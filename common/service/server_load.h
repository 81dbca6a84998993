// How busy a server is and what it needs. A plain value, measured by the server once a second.
#pragma once

#include <cstdint>

namespace cairn {

struct ServerLoad {
  double up_s = 0.0;                   // Since its start.
  double processor_s = 0.0;            // Processor time of all its threads since its start.
  std::uint64_t memory_bytes = 0;      // Resident.
  std::uint64_t inbound_waiting = 0;   // Samples, questions and session requests that no thread has looked at yet.
  std::uint64_t outbound_waiting = 0;  // Values that are not written to DDS yet.
  // From the moment at which a robot's estimator has work until a thread takes it, over the last 4,096 times.
  double strand_wait_p50_ms = 0.0;
  double strand_wait_p99_ms = 0.0;
  bool stores = false;  // Whether it keeps its state. If not, the rest is 0.
  std::uint64_t commits = 0;
  std::uint64_t failed_commits = 0;
  std::uint64_t store_bytes = 0;  // What the records take, as of a few seconds ago.
  // From a change until it was on the disk, over the last 4,096 commits.
  double stored_after_p50_ms = 0.0;
  double stored_after_p99_ms = 0.0;

  bool operator==(const ServerLoad&) const = default;
};

}  // namespace cairn
