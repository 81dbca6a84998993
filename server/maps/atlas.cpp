#include "server/maps/atlas.h"

#include <optional>
#include <utility>

namespace cairn::server {

Atlas::Atlas(const MapsOptions& options, double resolution_m, bool create_sites, asio::thread_pool& pool,
             Outbound& outbound, Journal* journal, Generation generation)
    : options_(options),
      resolution_m_(resolution_m),
      create_sites_(create_sites),
      pool_(pool),
      outbound_(outbound),
      journal_(journal),
      generation_(generation) {}

Result<void> Atlas::Restore() {
  if (journal_ == nullptr) return {};
  Store& store = journal_->store();
  const auto owners = store.Owners(RecordKind::kSite);
  if (!owners) return tl::unexpected(owners.error());
  for (const std::uint64_t owner : *owners) {
    std::optional<StoredSite> stored;
    const auto take = [&stored](std::uint64_t, std::string_view bytes) -> Result<void> {
      auto site = SiteOf(bytes);
      if (!site) return tl::unexpected(site.error());
      stored = std::move(*site);
      return {};
    };
    if (auto read = store.Read({.kind = RecordKind::kSite, .owner = owner}, take); !read) return read;
    const auto site = Make(stored->name, false);
    if (!site) return tl::unexpected(site.error());
    if (auto restored = (*site)->Restore(*stored); !restored) return restored;
  }
  return {};
}

Result<std::shared_ptr<Site>> Atlas::Enter(const std::string& name) {
  if (auto site = Find(name)) return site;
  if (!create_sites_) {
    return Fail(StatusCode::kNotFound, "site '" + name + "' is not served here (server.sites, server.create_sites)");
  }
  return Make(name, false);
}

Result<std::shared_ptr<Site>> Atlas::Create(const std::string& name) {
  return Make(name, true);
}

Result<std::shared_ptr<Site>> Atlas::Make(const std::string& name, bool configured) {
  if (auto valid = ValidateName("site", name); !valid) return tl::unexpected(valid.error());
  const MutexLock lock(mutex_);
  const auto found = sites_.find(name);
  if (found != sites_.end()) {
    found->second.configured |= configured;
    return found->second.site;
  }
  for (const auto& [other, place] : sites_) {
    if (HashName(other) == HashName(name)) {
      return Fail(StatusCode::kAlreadyExists,
                  "the names '" + name + "' and '" + other + "' have the same id; choose another name");
    }
  }
  if (!MakeRoom()) {
    return Fail(StatusCode::kResourceExhausted,
                std::to_string(sites_.size()) + " sites are open; the limit is maps.max_sites");
  }
  auto site = std::make_shared<Site>(name, resolution_m_, options_, pool_, outbound_, journal_, generation_);
  sites_.emplace(name, Place{site, configured});
  return site;
}

bool Atlas::MakeRoom() {
  if (sites_.size() < static_cast<std::size_t>(options_.max_sites)) return true;
  for (auto it = sites_.begin(); it != sites_.end(); ++it) {
    const Place& place = it->second;
    // Every session and every waiting piece of work holds its site. With a use count of one, only this map
    // holds it.
    const bool idle = !place.configured && place.site.use_count() == 1 && place.site->snapshot()->tiles.empty();
    if (!idle) continue;
    if (journal_ != nullptr) journal_->Remove({.kind = RecordKind::kSite, .owner = HashName(it->first)});
    sites_.erase(it);
    return true;
  }
  return false;
}

std::shared_ptr<Site> Atlas::Find(const std::string& name) const {
  const MutexLock lock(mutex_);
  const auto found = sites_.find(name);
  return found == sites_.end() ? nullptr : found->second.site;
}

std::vector<std::shared_ptr<Site>> Atlas::All() const {
  const MutexLock lock(mutex_);
  std::vector<std::shared_ptr<Site>> all;
  for (const auto& [name, place] : sites_) all.push_back(place.site);
  return all;
}

}  // namespace cairn::server
