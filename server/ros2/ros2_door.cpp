#include "server/ros2/ros2_door.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "common/options/number_text.h"

namespace cairn::server {
namespace {

constexpr std::chrono::milliseconds kTickPeriod{100};
// What ROS 2 programs expect of each other. A shorter lease would lose robots on a bad network.
constexpr double kParticipantLease_s = 20.0;

wire::WireOptions WireOf(const Ros2Options& options, const wire::WireOptions& native) {
  wire::WireOptions wire;
  wire.domain = options.domain;
  wire.interfaces = options.interfaces.empty() ? native.interfaces : SplitAtCommas(options.interfaces);
  wire.discovery_servers = options.discovery_server_names();
  wire.participant_lease_s = kParticipantLease_s;
  return wire;
}

}  // namespace

Result<std::unique_ptr<Ros2Door>> Ros2Door::Open(const Ros2Options& options, const wire::WireOptions& wire,
                                                 const ServerAbilities& abilities, Inbound& inbound,
                                                 Outbound& outbound) {
  auto rules = NamespaceRules::Parse(options.namespaces, options.site);
  if (!rules) return tl::unexpected(rules.error());
  auto bus = ros2::Bus::Create(WireOf(options, wire), "cairnd_ros2");
  if (!bus) return tl::unexpected(bus.error());
  std::unique_ptr<Ros2Door> door(new Ros2Door(options, *std::move(rules), *std::move(bus), abilities, inbound));
  outbound.Watch([to = door.get()](const OutboundValue& value) { return to->See(value); });
  return door;
}

Ros2Door::Ros2Door(const Ros2Options& options, NamespaceRules rules, std::unique_ptr<ros2::Bus> bus,
                   const ServerAbilities& abilities, Inbound& inbound)
    : options_(options),
      bus_(std::move(bus)),
      calls_(inbound),
      egress_(*bus_, options),
      ingress_(
          *bus_, options, std::move(rules), inbound, calls_,
          [this](const RobotAddress& address) { egress_.Serve(address); },
          [this](NameId robot_id) { egress_.Leave(robot_id); }),
      services_(*bus_, options, abilities, calls_,
                {[this](MapWish&& wish) { return egress_.WantMap(std::move(wish)); },
                 [this](const std::string& site) { ingress_.BeginAnew(site); }}) {}

// A value that is not seen because memory is short counts as one that was not published; the server goes on.
bool Ros2Door::See(const OutboundValue& value) {
  const auto* const reply = std::get_if<Reply>(&value);
  const bool own = reply != nullptr && calls_.IsOwn(*reply);
  static_cast<void>(unseen_.Guard([&] {
    if (own) return static_cast<void>(calls_.Take(*reply));
    services_.Take(value);
    ingress_.Take(value);
    egress_.See(value);
  }));
  return own;
}

Ros2Door::~Ros2Door() {
  Close();
  Finish();
}

void Ros2Door::Start() {
  egress_.Start();
  thread_ = std::jthread([this](const std::stop_token& stop) {
    const auto tick = [this] {
      ingress_.Tick(Ros2Ingress::Clock::now());
      services_.Tick(Ros2Services::Clock::now());
      calls_.Tick(CommandCalls::Clock::now());
    };
    static_cast<void>(failures_.Guard(tick));  // Requests have come while sessions were restored.
    bus_->Run(stop, tick, kTickPeriod, [this](const std::exception& error) { failures_.Count(error); });
  });
}

void Ros2Door::Close() {
  thread_ = {};
  ingress_.Close();
  services_.Close();
}

void Ros2Door::Finish() {
  egress_.Finish();
}

Ros2Report Ros2Door::report() const {
  Ros2Report report;
  report.door = {.enabled = true,
                 .domain = options_.domain,
                 .malformed = malformed(),
                 .overflow = overflow(),
                 .unpublished = unpublished(),
                 .problems = ingress_.problems()};
  std::vector<std::string>& problems = report.door.problems;
  for (std::string& problem : egress_.problems()) problems.push_back(std::move(problem));
  problems.resize(std::min(problems.size(), wire::kMaxRos2Problems));
  for (std::string& problem : problems) problem.resize(std::min(problem.size(), wire::kMaxTextBytes));
  report.namespaces = ingress_.report(Ros2Ingress::Clock::now());
  return report;
}

}  // namespace cairn::server
