#include "server/ingress/other_servers.h"

#include <algorithm>

namespace cairn::server {

Result<std::unique_ptr<OtherServers>> OtherServers::Watch(wire::Bus& bus) {
  auto requests = bus.Advertise<Request>();
  if (!requests) return tl::unexpected(requests.error());
  return std::unique_ptr<OtherServers>(new OtherServers(std::move(*requests)));
}

int OtherServers::count() const {
  return std::max(0, requests_->matched() - 1);
}

}  // namespace cairn::server
