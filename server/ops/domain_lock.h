// Ensures that no other server on this machine serves the same DDS domain on the same address: both would
// receive all scans and requests of the domain. The lock is one abstract Unix socket per address. The kernel
// releases it when the process ends, also after a crash. Each network namespace has its own names. Source:
// unix(7). Thread rule: any thread.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "common/status.h"

namespace cairn::server {

class DomainLock {
 public:
  // kAlreadyExists: another server holds the lock for one of the addresses.
  [[nodiscard]] static Result<DomainLock> Take(std::int64_t domain, const std::vector<std::string>& addresses);
  DomainLock(DomainLock&& other) noexcept : sockets_(std::move(other.sockets_)) { other.sockets_.clear(); }
  DomainLock& operator=(DomainLock&&) = delete;
  ~DomainLock();

 private:
  DomainLock() = default;

  std::vector<int> sockets_;
};

}  // namespace cairn::server
