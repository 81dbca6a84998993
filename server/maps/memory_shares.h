// How the memory that all sites together may take is divided among them. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <vector>

namespace cairn::server {

// What one site takes.
struct SiteMemory {
  std::uint64_t bytes = 0;
  bool gives_no_more = false;  // It has given up all that it can.
};

// The bytes that each site may take so that all together stay within `total`; 0: no limit is needed. Sites that take
// less keep what they have, and the rest is divided equally among those that take more. What is taken by sites that can
// give no more is missing for the others.
[[nodiscard]] std::uint64_t MemoryShare(const std::vector<SiteMemory>& sites, std::uint64_t total);

// What is said about memory stays until less than this part of a limit is taken. Otherwise each change of a map that
// takes about as much as it may would say it anew, and raise the alert again.
inline constexpr double kClearlyBelowLimit = 0.95;
[[nodiscard]] constexpr bool IsClearlyBelow(std::uint64_t bytes, std::uint64_t limit) {
  return static_cast<double>(bytes) < kClearlyBelowLimit * static_cast<double>(limit);
}
[[nodiscard]] bool AreClearlyBelow(const std::vector<SiteMemory>& sites, std::uint64_t total);

// Of an option in MiB.
[[nodiscard]] constexpr std::uint64_t BytesOfMib(double mib) {
  return static_cast<std::uint64_t>(mib * 1024.0 * 1024.0);
}

}  // namespace cairn::server
