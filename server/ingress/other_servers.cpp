#include "server/ingress/other_servers.h"

#include <algorithm>
#include <thread>

namespace cairn::server {

Result<std::unique_ptr<OtherServers>> OtherServers::Watch(wire::Bus& bus) {
  auto requests = bus.Advertise<Request>();
  if (!requests) return tl::unexpected(requests.error());
  return std::unique_ptr<OtherServers>(new OtherServers(std::move(*requests)));
}

bool OtherServers::FoundWithin(std::chrono::milliseconds time) const {
  const auto end = std::chrono::steady_clock::now() + time;
  while (requests_->matched() == 0) {
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

int OtherServers::count() const {
  return std::max(0, requests_->matched() - 1);
}

}  // namespace cairn::server
