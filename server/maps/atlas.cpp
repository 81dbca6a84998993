#include "server/maps/atlas.h"

#include <utility>

namespace cairn::server {

Atlas::Atlas(const MapsOptions& options, double resolution_m, bool create_sites, asio::thread_pool& pool,
             SitePorts ports)
    : options_(options),
      resolution_m_(resolution_m),
      create_sites_(create_sites),
      pool_(pool),
      ports_(std::move(ports)) {}

Result<std::shared_ptr<Site>> Atlas::Enter(const std::string& name) {
  if (auto site = Find(name)) return site;
  if (!create_sites_) {
    return Fail(StatusCode::kNotFound, "site '" + name + "' is not served here (server.sites, server.create_sites)");
  }
  return Create(name);
}

Result<std::shared_ptr<Site>> Atlas::Create(const std::string& name) {
  if (auto valid = ValidateName("site", name); !valid) return tl::unexpected(valid.error());
  const MutexLock lock(mutex_);
  const auto found = sites_.find(name);
  if (found != sites_.end()) return found->second;
  if (sites_.size() >= static_cast<std::size_t>(options_.max_sites)) {
    return Fail(StatusCode::kResourceExhausted,
                std::to_string(sites_.size()) + " sites are open; the limit is maps.max_sites");
  }
  for (const auto& [other, site] : sites_) {
    if (HashName(other) == HashName(name)) {
      return Fail(StatusCode::kAlreadyExists, "the names '" + name + "' and '" + other + "' share an id");
    }
  }
  auto site = std::make_shared<Site>(name, resolution_m_, options_, pool_, ports_);
  sites_.emplace(name, site);
  return site;
}

std::shared_ptr<Site> Atlas::Find(const std::string& name) const {
  const MutexLock lock(mutex_);
  const auto found = sites_.find(name);
  return found == sites_.end() ? nullptr : found->second;
}

std::vector<std::shared_ptr<Site>> Atlas::All() const {
  const MutexLock lock(mutex_);
  std::vector<std::shared_ptr<Site>> all;
  for (const auto& [name, site] : sites_) all.push_back(site);
  return all;
}

}  // namespace cairn::server
