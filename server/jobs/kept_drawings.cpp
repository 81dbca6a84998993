#include "server/jobs/kept_drawings.h"

#include <algorithm>

namespace cairn::server {

KeptDrawings::OfSite& KeptDrawings::Open(const std::string& site) {
  Site& opened = sites_[site];
  opened.job = jobs_++;
  return opened.drawings;
}

void KeptDrawings::Close(const std::string& site, const std::vector<std::uint64_t>& sessions,
                         const std::function<bool(const std::string& site)>& site_exists) {
  std::erase_if(sites_, [&](const auto& one) { return !site_exists(one.first); });
  if (const auto found = sites_.find(site); found != sites_.end()) {
    std::erase_if(found->second.drawings,
                  [&](const auto& one) { return std::ranges::find(sessions, one.first) == sessions.end(); });
  }
  while (!sites_.empty() && Bytes() > most_bytes_) {
    sites_.erase(std::ranges::min_element(sites_, {}, [](const auto& one) { return one.second.job; }));
  }
}

std::size_t KeptDrawings::Bytes() const {
  std::size_t bytes = 0;
  for (const auto& [name, site] : sites_)
    for (const auto& [session, drawn] : site.drawings) bytes += drawn.Bytes();
  return bytes;
}

}  // namespace cairn::server
