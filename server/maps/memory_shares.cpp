#include "server/maps/memory_shares.h"

#include <algorithm>

namespace cairn::server {

bool AreClearlyBelow(const std::vector<SiteMemory>& sites, std::uint64_t total) {
  std::uint64_t all = 0;
  for (const SiteMemory& site : sites) all += site.bytes;
  return IsClearlyBelow(all, total);
}

std::uint64_t MemoryShare(const std::vector<SiteMemory>& sites, std::uint64_t total) {
  std::uint64_t all = 0, fixed = 0;
  std::vector<std::uint64_t> others;
  for (const SiteMemory& site : sites) {
    all += site.bytes;
    if (site.gives_no_more) {
      fixed += site.bytes;
    } else {
      others.push_back(site.bytes);
    }
  }
  if (all <= total) return 0;
  std::uint64_t rest = total - std::min(total, fixed);
  std::ranges::sort(others);
  std::uint64_t left = others.size();
  for (const std::uint64_t bytes : others) {
    if (bytes > rest / left) return std::max<std::uint64_t>(rest / left, 1);
    rest -= bytes;
    --left;
  }
  return 1;  // No site can give up anything.
}

}  // namespace cairn::server
