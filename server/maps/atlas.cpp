#include "server/maps/atlas.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <latch>
#include <optional>
#include <random>
#include <utility>

#include "server/maps/memory_shares.h"
#include "server/store/site_contents.h"

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

Result<StoredSite> Atlas::Stored(NameId owner) const {
  std::optional<StoredSite> stored;
  const auto take = [&stored, owner](std::uint64_t, std::string_view bytes) -> Result<void> {
    auto site = SiteOf(bytes);
    if (!site) return tl::unexpected(site.error());
    if (HashName(site->name) != owner) return Fail(StatusCode::kDataLoss, "the record is that of another site");
    stored = std::move(*site);
    return {};
  };
  if (auto read = journal_->store().Read({.kind = RecordKind::kSite, .owner = owner}, take); !read)
    return tl::unexpected(read.error());
  if (!stored) return Fail(StatusCode::kNotFound, "the store has no such site");
  return *std::move(stored);
}

Result<void> Atlas::Restore(StartControl& control) {
  if (journal_ == nullptr) return {};
  const auto owners = journal_->store().Owners(RecordKind::kSite);
  if (!owners) return tl::unexpected(owners.error());
  for (const std::uint64_t owner : *owners) {
    const auto stored = Stored(owner);
    if (!stored) {
      PutAside(owner, stored.error());
      continue;
    }
    const auto site = Make(stored->name, Why::kStored);
    if (!site) return tl::unexpected(site.error());
    if (auto restored = (*site)->Restore(*stored, control); !restored) return restored;
  }
  return PutRemainsAside({owners->begin(), owners->end()});
}

// Parts of maps whose site has no record, because that is damaged in a way that hides it. A new site of the name would
// write over them.
Result<void> Atlas::PutRemainsAside(const std::set<NameId>& known) {
  std::set<NameId> remains;
  for (const RecordKind kind : {RecordKind::kMapVersion, RecordKind::kLayer}) {
    const auto owners = journal_->store().Owners(kind);
    if (!owners) return tl::unexpected(owners.error());
    for (const NameId owner : *owners) {
      if (!known.contains(owner)) remains.insert(owner);
    }
  }
  for (const NameId owner : remains)
    PutAside(owner, {StatusCode::kDataLoss, "its own record is missing, and parts of its map are there"});
  return {};
}

void Atlas::PutAside(NameId owner, const Status& why) {
  const std::string name = NameOfSite(journal_->store(), owner);
  const std::string what = name.empty() ? "the site with the id " + std::to_string(owner) : "site '" + name + "'";
  spdlog::error("{}", journal_->set_aside().Add(name, what, why));
  const MutexLock lock(mutex_);
  set_aside_[owner] = why.message;
}

void Atlas::SetAside(const std::string& name, const Status& why) {
  PutAside(HashName(name), why);
  Release(name);
}

bool Atlas::IsSetAside(const std::string& name) const {
  const MutexLock lock(mutex_);
  return set_aside_.contains(HashName(name));
}

void Atlas::ForgetSetAside(const std::string& name) {
  const MutexLock lock(mutex_);
  set_aside_.erase(HashName(name));
}

Result<void> Atlas::Reserve(const std::string& name) {
  const MutexLock lock(mutex_);
  if (const auto found = sites_.find(name); found != sites_.end()) {
    if (!Idle(found->second))
      return Fail(StatusCode::kAlreadyExists,
                  "there is a site '" + name + "' already; delete it, or load as another one");
    Erase(found);
  }
  if (auto free = CheckName(name); !free) return free;
  if (!MakeRoom()) return Fail(StatusCode::kResourceExhausted, "the limit maps.max_sites is reached");
  reserved_.insert(name);
  return {};
}

void Atlas::Release(const std::string& name) {
  const MutexLock lock(mutex_);
  reserved_.erase(name);
}

Result<void> Atlas::OpenStored(const std::string& name) {
  const auto stored = Stored(HashName(name));
  if (!stored) return tl::unexpected(stored.error());
  std::shared_ptr<Site> site;
  {
    const MutexLock lock(mutex_);
    site = NewSite(name);
  }
  StartControl control;
  if (auto restored = site->Restore(*stored, control); !restored) return restored;
  site->SetLoading(true);
  const MutexLock lock(mutex_);
  sites_.emplace(name, Place{std::move(site), false});
  reserved_.erase(name);
  return {};
}

void Atlas::Remove(const std::string& name) {
  const MutexLock lock(mutex_);
  const auto found = sites_.find(name);
  if (found == sites_.end()) return;
  const MapInfo last = found->second.site->snapshot()->info;
  // Two epochs higher: the site publishes its removal under the next one.
  beginning_.epoch = std::max(beginning_.epoch, last.epoch + 2);
  beginning_.tile_version = std::max(beginning_.tile_version, last.version + 2);
  sites_.erase(found);
  reserved_.insert(name);
}

Result<std::shared_ptr<Site>> Atlas::Enter(const std::string& name) {
  if (auto site = Find(name)) return site;
  if (!create_sites_) {
    return Fail(StatusCode::kNotFound, "site '" + name + "' is not served here (server.sites, server.create_sites)");
  }
  return Make(name, Why::kEntered);
}

Result<std::shared_ptr<Site>> Atlas::Create(const std::string& name) {
  return Make(name, Why::kConfigured);
}

Result<std::shared_ptr<Site>> Atlas::Make(const std::string& name, Why why) {
  if (auto valid = ValidateName("site", name); !valid) return tl::unexpected(valid.error());
  const MutexLock lock(mutex_);
  const auto found = sites_.find(name);
  if (found != sites_.end()) {
    found->second.configured |= why == Why::kConfigured;
    return found->second.site;
  }
  if (auto free = CheckName(name); !free) return tl::unexpected(free.error());
  if (why == Why::kEntered && !MakeRoom()) {
    return Fail(StatusCode::kResourceExhausted,
                std::to_string(sites_.size()) + " sites are open; the limit is maps.max_sites");
  }
  auto site = NewSite(name);
  sites_.emplace(name, Place{site, why == Why::kConfigured});
  return site;
}

std::shared_ptr<Site> Atlas::NewSite(const std::string& name) const {
  Site::Beginning beginning = beginning_;
  std::random_device random;  // No server, also on another machine, may draw the same number again.
  beginning.map_frame = (std::uint64_t{random()} << 32 | random()) | 1;
  return std::make_shared<Site>(name, resolution_m_, options_, pool_, outbound_, journal_, generation_, beginning);
}

Result<void> Atlas::CheckName(const std::string& name) const {
  if (reserved_.contains(name))
    return Fail(StatusCode::kUnavailable, "site '" + name + "' is being loaded or deleted; try again later");
  if (const auto aside = set_aside_.find(HashName(name)); aside != set_aside_.end()) {
    return Fail(StatusCode::kFailedPrecondition,
                "site '" + name + "' is set aside (" + aside->second + "); to begin anew, delete it");
  }
  const auto same_id = [&name](const std::string& other) {
    return Fail(StatusCode::kAlreadyExists,
                "the names '" + name + "' and '" + other + "' have the same id; choose another name");
  };
  for (const std::string& other : reserved_) {
    if (HashName(other) == HashName(name)) return same_id(other);
  }
  for (const auto& [other, place] : sites_) {
    if (HashName(other) == HashName(name)) return same_id(other);
  }
  return {};
}

bool Atlas::Idle(const Place& place) const {
  // Every session and every waiting piece of work holds its site. With a use count of one, only this map holds it.
  const auto last = place.site->snapshot();
  return place.site.use_count() == 1 && !place.site->begun() && last->info.versions.size() <= 1;
}

void Atlas::Erase(std::map<std::string, Place>::iterator place) {
  if (journal_ != nullptr) journal_->Remove({.kind = RecordKind::kSite, .owner = HashName(place->first)});
  MapInfo gone;
  gone.site_id = HashName(place->first);
  gone.site = place->first;
  gone_.push_back(std::move(gone));
  sites_.erase(place);
}

void Atlas::Retire(MapInfo gone) {
  const MutexLock lock(mutex_);
  gone_.push_back(std::move(gone));
}

bool Atlas::MakeRoom() {
  if (sites_.size() + reserved_.size() < static_cast<std::size_t>(options_.max_sites)) return true;
  for (auto it = sites_.begin(); it != sites_.end(); ++it) {
    if (it->second.configured || !Idle(it->second)) continue;
    Erase(it);
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

void Atlas::Publish() {
  {
    const MutexLock lock(mutex_);
    std::erase_if(gone_, [this](const MapInfo& gone) CAIRN_REQUIRES(mutex_) {
      return sites_.contains(gone.site) || outbound_.Send(Retired{gone});
    });
  }
  auto others = All();
  if (others.empty()) return;
  ShareMemory(others);
  const auto next = others.begin() + static_cast<std::ptrdiff_t>(first_++ % others.size());
  const std::shared_ptr<Site> first = *next;
  others.erase(next);
  first->Publish([others = std::move(others)] {
    for (const auto& site : others) site->Publish();
  });
}

// Each site follows when it publishes.
void Atlas::ShareMemory(const std::vector<std::shared_ptr<Site>>& sites) const {
  const std::uint64_t total = BytesOfMib(options_.max_total_memory_mib);
  if (total == 0) return;
  std::vector<SiteMemory> taken;
  taken.reserve(sites.size());
  for (const auto& site : sites) taken.push_back({site->snapshot()->info.memory_bytes, site->gives_no_more()});
  const std::uint64_t share = MemoryShare(taken, total);
  const bool clearly_below = AreClearlyBelow(taken, total);
  for (const auto& site : sites) site->SetMemoryShare(share, clearly_below);
}

void Atlas::Close() {
  const auto sites = All();
  std::latch open(static_cast<std::ptrdiff_t>(sites.size()));
  for (const auto& site : sites) {
    try {
      site->Close([&open] { open.count_down(); });
    } catch (const std::exception& error) {
      spdlog::error("the end of a site failed with an exception: {}", error.what());
      open.count_down();
    }
  }
  open.wait();
}

}  // namespace cairn::server
