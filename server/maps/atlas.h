// All sites by name. A site is created when the first robot enters it, if the server may create sites, and is
// kept. When maps.max_sites is reached, a new site replaces one that is empty (no tile, no session) and not
// configured, so that misspelt names do not use up the sites. Thread rule: any thread.
#pragma once

#include <asio/thread_pool.hpp>
#include <map>
#include <memory>
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

  // Restores the sites of earlier servers. REQUIRES: no other function was called before. DATA_LOSS: a record is
  // damaged. FAILED_PRECONDITION: a newer server has written it.
  Result<void> Restore();

  // Returns the site; creates it if it does not exist and the server may create it. NOT_FOUND: the server may
  // not. RESOURCE_EXHAUSTED: too many sites. INVALID_ARGUMENT: not a valid name.
  Result<std::shared_ptr<Site>> Enter(const std::string& name);
  // For the configured sites: like Enter, but independent of `create_sites`, and the site is never replaced.
  Result<std::shared_ptr<Site>> Create(const std::string& name);
  [[nodiscard]] std::shared_ptr<Site> Find(const std::string& name) const;
  [[nodiscard]] std::vector<std::shared_ptr<Site>> All() const;

 private:
  struct Place {
    std::shared_ptr<Site> site;
    bool configured = false;
  };
  Result<std::shared_ptr<Site>> Make(const std::string& name, bool configured);
  bool MakeRoom() CAIRN_REQUIRES(mutex_);

  const MapsOptions options_;
  const double resolution_m_;
  const bool create_sites_;
  asio::thread_pool& pool_;
  Outbound& outbound_;
  Journal* const journal_;
  const Generation generation_;

  mutable Mutex mutex_;
  std::map<std::string, Place> sites_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
