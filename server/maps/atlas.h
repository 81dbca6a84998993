// All sites by name. Sites are created when the first robot enters, if the server may create them, and stay.
// Thread rule: any thread.
#pragma once

#include <asio/thread_pool.hpp>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "server/maps/site.h"

namespace cairn::server {

class Atlas {
 public:
  Atlas(const MapsOptions& options, double resolution_m, bool create_sites, asio::thread_pool& pool, SitePorts ports);

  // The site; made where it does not exist yet and may. NOT_FOUND, RESOURCE_EXHAUSTED, INVALID_ARGUMENT.
  Result<std::shared_ptr<Site>> Enter(const std::string& name);
  // As Enter, whatever `create_sites` says: for the configured sites.
  Result<std::shared_ptr<Site>> Create(const std::string& name);
  [[nodiscard]] std::shared_ptr<Site> Find(const std::string& name) const;
  [[nodiscard]] std::vector<std::shared_ptr<Site>> All() const;

 private:
  const MapsOptions options_;
  const double resolution_m_;
  const bool create_sites_;
  asio::thread_pool& pool_;
  const SitePorts ports_;

  mutable Mutex mutex_;
  std::map<std::string, std::shared_ptr<Site>> sites_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
