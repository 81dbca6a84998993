#include "server/ingress/other_servers.h"

#include <algorithm>
#include <utility>

namespace cairn::server {

Result<std::unique_ptr<OtherServers>> OtherServers::Watch(wire::Bus& bus) {
  auto requests = bus.Advertise<Request>();
  if (!requests) return tl::unexpected(requests.error());
  return std::unique_ptr<OtherServers>(new OtherServers(std::move(*requests)));
}

int OtherServers::count() const {
  return std::max(0, requests_->matched() - 1);
}

bool OtherServers::Joined() {
  const int now = count();
  return now > std::exchange(known_, now);
}

}  // namespace cairn::server
