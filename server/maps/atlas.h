// All sites by name. A site is created when the first robot enters it, if the server may create sites, and is
// kept. When maps.max_sites is reached, a new site replaces one that is empty (nothing drawn, no version, no session)
// and not configured, so that misspelt names do not use up the sites. Thread rule: any thread.
#pragma once

#include <asio/thread_pool.hpp>
#include <atomic>
#include <cstddef>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "server/maps/site.h"
#include "server/store/journal.h"

namespace cairn::server {

class Atlas {
 public:
  // `journal`: null if nothing is stored. `generation`: the number of this start of the server.
  Atlas(const MapsOptions& options, double resolution_m, bool create_sites, asio::thread_pool& pool, Outbound& outbound,
        Journal* journal = nullptr, Generation generation = 0);

  // Restores the sites of earlier servers. REQUIRES: no other function was called before. A site whose own record
  // cannot be read, or is missing while parts of its map are there, is set aside: nobody can enter it or make another
  // of its name until it is deleted. Of the others, only the records that cannot be read are left out.
  // FAILED_PRECONDITION: the cells have another size here.
  Result<void> Restore(StartControl& control);
  [[nodiscard]] bool IsSetAside(const std::string& name) const;
  // The site was deleted from the store; its name is free again.
  void ForgetSetAside(const std::string& name);

  // Opens one more site that is stored by now, under a name that was reserved; then the name is free again. Not for
  // the dispatcher: it reads the store.
  Result<void> OpenStored(const std::string& name);
  // Nobody else can make a site of this name until it is opened or released. A site that holds nothing gives way.
  // ALREADY_EXISTS: there is one. RESOURCE_EXHAUSTED: too many sites.
  Result<void> Reserve(const std::string& name);
  void Release(const std::string& name);
  // What was removed could not be deleted from the store: its name stays taken until it is.
  void SetAside(const std::string& name, const Status& why);
  // The site is not found any more, and nobody can make another of this name until it is released. Those who have it
  // keep it. Sites that are made from now on begin above its epoch.
  void Remove(const std::string& name);
  [[nodiscard]] double resolution_m() const { return resolution_m_; }

  // Returns the site; creates it if it does not exist and the server may create it. NOT_FOUND: the server may
  // not. RESOURCE_EXHAUSTED: too many sites. INVALID_ARGUMENT: not a valid name.
  Result<std::shared_ptr<Site>> Enter(const std::string& name);
  // For the configured sites: like Enter, but independent of `create_sites`, and the site is never replaced.
  Result<std::shared_ptr<Site>> Create(const std::string& name);
  [[nodiscard]] std::shared_ptr<Site> Find(const std::string& name) const;
  [[nodiscard]] std::vector<std::shared_ptr<Site>> All() const;
  // Every site publishes what changed. Another one is the first each time, and the others wait for it, because one site
  // may fill the lane.
  void Publish();
  // The site is gone, and what says so is sent. The next Publish retires its key, unless there is one of its name
  // again.
  void Retire(MapInfo gone);
  // The server stops: closes every site, which publishes what has changed, and waits for all. REQUIRES: the pool is
  // running.
  void Close();

 private:
  struct Place {
    std::shared_ptr<Site> site;
    bool configured = false;
  };
  // A stored or configured one has room although there may be more than maps.max_sites by now: none gives way to
  // another one before its sessions are restored.
  enum class Why { kEntered, kConfigured, kStored };
  Result<std::shared_ptr<Site>> Make(const std::string& name, Why why);
  std::shared_ptr<Site> NewSite(const std::string& name) const CAIRN_REQUIRES(mutex_);
  Result<StoredSite> Stored(NameId owner) const;
  void PutAside(NameId owner, const Status& why);
  Result<void> PutRemainsAside(const std::set<NameId>& known);
  Result<void> CheckName(const std::string& name) const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool Idle(const Place& place) const;
  void Erase(std::map<std::string, Place>::iterator place) CAIRN_REQUIRES(mutex_);
  bool MakeRoom() CAIRN_REQUIRES(mutex_);
  void ShareMemory(const std::vector<std::shared_ptr<Site>>& sites) const;

  const MapsOptions options_;
  const double resolution_m_;
  const bool create_sites_;
  asio::thread_pool& pool_;
  Outbound& outbound_;
  Journal* const journal_;
  const Generation generation_;

  mutable Mutex mutex_;
  std::map<std::string, Place> sites_ CAIRN_GUARDED_BY(mutex_);
  std::set<std::string> reserved_ CAIRN_GUARDED_BY(mutex_);
  std::vector<MapInfo> gone_ CAIRN_GUARDED_BY(mutex_);                // Sites whose keys on the wire are to be retired.
  std::map<NameId, std::string> set_aside_ CAIRN_GUARDED_BY(mutex_);  // Why each of these sites was not restored.
  Site::Beginning beginning_ CAIRN_GUARDED_BY(mutex_);                // For the next site.
  std::atomic<std::size_t> first_ = 0;                                // Counts the calls of Publish.
};

}  // namespace cairn::server
