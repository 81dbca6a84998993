// Earlier sessions that their sites can do without (roster.h).
#include <memory>
#include <utility>
#include <vector>

#include "server/robots/roster.h"

namespace cairn::server {

// As where there are more than robots.max_earlier. A session that a robot may go on with stays.
void Roster::ForgetSpareSessions() {
  std::vector<std::shared_ptr<Session>> freed;  // Destroyed after the lock is released.
  for (const auto& site : atlas_.All()) {
    const SessionId spare = site->spare_session();
    if (spare == 0) continue;
    const MutexLock lock(mutex_);
    const auto found = earlier_.find(spare);
    if (found == earlier_.end()) continue;
    freed.push_back(std::move(found->second));
    earlier_.erase(found);
  }
}

}  // namespace cairn::server
