#include <arpa/inet.h>
#include <ifaddrs.h>
#include <netinet/in.h>

#include <cmath>
#include <set>

#include "common/wire/bus.h"
#include "common/wire/discovery_servers.h"

namespace cairn::wire {
namespace {

std::set<std::string> LocalAddresses() {
  std::set<std::string> addresses;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return addresses;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET) continue;
    char text[INET_ADDRSTRLEN] = {};
    const auto* address = reinterpret_cast<const sockaddr_in*>(entry->ifa_addr);
    if (inet_ntop(AF_INET, &address->sin_addr, text, sizeof(text)) != nullptr) addresses.emplace(text);
  }
  freeifaddrs(list);
  return addresses;
}

std::string Join(const std::vector<std::string>& parts) {
  std::string joined;
  for (const std::string& part : parts) joined += (joined.empty() ? "" : ",") + part;
  return joined;
}

std::vector<std::string> Split(const std::string& text) {
  std::vector<std::string> parts;
  std::string part;
  for (const char c : text + ",") {
    if (c != ',') {
      if (c != ' ') part += c;
    } else if (!part.empty()) {
      parts.push_back(std::exchange(part, {}));
    }
  }
  return parts;
}

}  // namespace

Result<void> Validate(const WireOptions& options) {
  constexpr std::int64_t kMaxDomain = 232;  // A larger domain would need ports beyond 16 bits (RTPS 9.6.1.1).
  if (options.domain < 0 || options.domain > kMaxDomain) {
    return Fail(StatusCode::kInvalidArgument, "wire.domain: " + std::to_string(options.domain) + " is not in 0..232");
  }
  if (options.interfaces.empty()) {
    return Fail(StatusCode::kInvalidArgument, "wire.interfaces: name at least one IPv4 address of this machine");
  }
  std::set<std::string> addresses;
  for (const std::string& address : options.interfaces) {
    in_addr bytes{};
    if (inet_pton(AF_INET, address.c_str(), &bytes) != 1) {
      return Fail(StatusCode::kInvalidArgument, "wire.interfaces: '" + address + "' is not an IPv4 address");
    }
    if (!addresses.insert(address).second) {
      return Fail(StatusCode::kInvalidArgument, "wire.interfaces: " + address + " is named twice");
    }
  }
  constexpr std::size_t kMostServers = 255;  // Their numbers are bytes of their GUIDs.
  if (options.discovery_servers.size() > kMostServers)
    return Fail(StatusCode::kInvalidArgument, "wire.discovery_servers: at most " + std::to_string(kMostServers));
  for (const std::string& server : options.discovery_servers) {
    if (auto parsed = ParseDiscoveryServer(server); !parsed)
      return Fail(StatusCode::kInvalidArgument, "wire.discovery_servers: " + parsed.error().message);
  }
  if (!options.discovery_servers.empty() && !options.security.empty()) {
    return Fail(StatusCode::kInvalidArgument,
                "wire.discovery_servers: Debian's discovery server has no identity of a fleet; leave wire.security or "
                "wire.discovery_servers empty");
  }
  for (const double lease : {options.liveliness_lease_s, options.participant_lease_s}) {
    if (!std::isfinite(lease) || lease < 0.1 || lease > 3600.0) {
      return Fail(StatusCode::kInvalidArgument, "wire: a lease of " + std::to_string(lease) + " s is not in 0.1..3600");
    }
  }
  return {};
}

Result<void> RequireInterfaces(const WireOptions& options) {
  const std::set<std::string> local = LocalAddresses();
  for (const std::string& address : options.interfaces) {
    // Without this check Fast DDS would ignore the address and bind nothing, without an error.
    if (local.count(address) == 0) {
      return Fail(StatusCode::kUnavailable, "wire.interfaces: this machine has no address " + address);
    }
  }
  return {};
}

void Visit(OptionVisitor& visitor, WireOptions& options) {
  visitor.Integer("domain", options.domain, "", 0, 232,
                  ForOperators("DDS domain. The robots, the server and the clients of one fleet use the same one."));
  std::string interfaces = Join(options.interfaces);
  visitor.Text("interfaces", interfaces,
               ForOperators("IPv4 addresses of this machine that the server uses, separated by commas. Only these are "
                            "bound: everybody in the networks behind them is trusted."));
  options.interfaces = Split(interfaces);
  visitor.Real("liveliness_lease_s", options.liveliness_lease_s, "s", 0.1, 3600.0,
               ForOperators("A robot or client that is silent for longer counts as away. The whole fleet uses the same "
                            "value, or the robots a smaller one."));
  visitor.Real("participant_lease_s", options.participant_lease_s, "s", 0.1, 3600.0,
               "A process that is silent for longer is forgotten, and is discovered anew when it returns.");
  visitor.Text(
      "security", options.security,
      ForOperators("Directory with the identity and the permissions of this program, made by "
                   "deploy/security/make-fleet.sh. Empty: DDS Security is off, and everybody in these networks "
                   "is trusted."));
  std::string servers = Join(options.discovery_servers);
  visitor.Text("discovery_servers", servers,
               ForOperators("Where multicast does not reach: the addresses of discovery servers of Fast DDS "
                            "(fast-discovery-server), separated by commas, each with :PORT where it is not 11811. The "
                            "first one has number 0. All programs of a fleet use the same ones. Empty: programs find "
                            "each other by multicast."));
  options.discovery_servers = Split(servers);
  visitor.Require(options.liveliness_lease_s <= options.participant_lease_s, "liveliness_lease_s", "must not exceed",
                  "participant_lease_s");
}

}  // namespace cairn::wire
