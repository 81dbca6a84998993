#include "common/wire/discovery_servers.h"

#include <arpa/inet.h>

#include <charconv>

namespace cairn::wire {

Result<DiscoveryServer> ParseDiscoveryServer(const std::string& text) {
  constexpr std::uint16_t kDefaultPort = 11811;  // That of fast-discovery-server.
  const auto colon = text.find(':');
  DiscoveryServer server{text.substr(0, colon), kDefaultPort};
  in_addr bytes{};
  if (inet_pton(AF_INET, server.address.c_str(), &bytes) != 1)
    return Fail(StatusCode::kInvalidArgument, "'" + text + "' is not an IPv4 address, or one with :PORT behind it");
  if (colon == std::string::npos) return server;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data() + colon + 1, end, server.port);
  if (error != std::errc() || rest != end || server.port == 0)
    return Fail(StatusCode::kInvalidArgument, "'" + text + "': the port is a number from 1 to 65535");
  return server;
}

}  // namespace cairn::wire
