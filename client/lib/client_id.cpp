#include "client/lib/client_id.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <random>

namespace cairn::client {

ClientId NewClientId() {
  std::random_device device;
  ClientId id = 0;
  while (id == 0) id = static_cast<ClientId>(device()) << 32 | device();
  return id;
}

std::string NoServer(const wire::Bus& bus, double timeout_s) {
  return fmt::format("no server answers on domain {} at {} within {:.1f} s", bus.options().domain,
                     fmt::join(bus.options().interfaces, ", "), timeout_s);
}

}  // namespace cairn::client
