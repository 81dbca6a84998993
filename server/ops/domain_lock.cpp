#include "server/ops/domain_lock.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <utility>

namespace cairn::server {

Result<DomainLock> DomainLock::Take(std::int64_t domain, const std::vector<std::string>& addresses) {
  DomainLock lock;
  for (const std::string& address : addresses) {
    const std::string name = "cairnd/" + std::to_string(domain) + "/" + address;
    sockaddr_un place{};
    place.sun_family = AF_UNIX;
    // The first byte stays 0, which makes the socket abstract: its name is not a file.
    const std::size_t length = std::min(name.size(), sizeof(place.sun_path) - 1);
    std::memcpy(place.sun_path + 1, name.data(), length);
    const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (socket < 0)
      return Fail(StatusCode::kUnavailable,
                  std::string("cannot make the socket that locks the domain: ") + std::strerror(errno));
    lock.sockets_.push_back(socket);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + length);
    if (bind(socket, reinterpret_cast<const sockaddr*>(&place), size) == 0) continue;
    if (errno != EADDRINUSE)
      return Fail(StatusCode::kUnavailable, "cannot lock the DDS domain: " + std::string(std::strerror(errno)));
    return Fail(StatusCode::kAlreadyExists, "another server serves DDS domain " + std::to_string(domain) + " on " +
                                                address + "; use another domain (--domain, CAIRN_DOMAIN)");
  }
  return lock;
}

DomainLock::~DomainLock() {
  for (const int socket : sockets_) close(socket);
}

}  // namespace cairn::server
