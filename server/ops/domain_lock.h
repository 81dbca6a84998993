// That no other server of this machine serves the same DDS domain on the same address: two would share scans and
// questions without knowing. Names in the kernel (abstract Unix sockets) that go with the process, however it ends; a
// network namespace has its own. Source: unix(7). Thread rule: any thread.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "common/status.h"

namespace cairn::server {

class DomainLock {
 public:
  // kAlreadyExists where another holds one of the addresses.
  [[nodiscard]] static Result<DomainLock> Take(std::int64_t domain, const std::vector<std::string>& addresses);
  DomainLock(DomainLock&& other) noexcept : sockets_(std::move(other.sockets_)) { other.sockets_.clear(); }
  DomainLock& operator=(DomainLock&&) = delete;
  ~DomainLock();

 private:
  DomainLock() = default;

  std::vector<int> sockets_;
};

}  // namespace cairn::server
