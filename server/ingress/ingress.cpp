#include "server/ingress/ingress.h"

#include <spdlog/spdlog.h>

#include <numeric>
#include <utility>

#include "server/ingress/admission.h"

namespace cairn::server {

Result<std::unique_ptr<Ingress>> Ingress::Open(wire::Bus& bus, Inbound& inbound, Outbound& outbound) {
  std::unique_ptr<Ingress> ingress(new Ingress(inbound, outbound));
  if (auto subscribed = ingress->Subscribe(bus); !subscribed) return tl::unexpected(subscribed.error());
  return ingress;
}

Ingress::~Ingress() {
  Close();
}

void Ingress::Close() {
  malformed_until_closed_ = malformed();
  subscriptions_.clear();
}

std::uint64_t Ingress::malformed() const {
  return std::accumulate(subscriptions_.begin(), subscriptions_.end(), malformed_until_closed_,
                         [](std::uint64_t sum, const auto& subscription) { return sum + subscription->refused(); });
}

template <typename Value>
Result<void> Ingress::Add(wire::Bus& bus, void (Ingress::*take)(Value&&), wire::SubscriptionEvents events) {
  events.incompatible_qos = [](const std::string& policy) {
    spdlog::warn("a client cannot connect: its QoS policy {} is incompatible with the server's (see idl/README.md)",
                 policy);
  };
  auto subscription =
      bus.Subscribe<Value>([this, take](Value&& value) { (this->*take)(std::move(value)); }, std::move(events));
  if (!subscription) return tl::unexpected(subscription.error());
  subscriptions_.push_back(std::move(*subscription));
  return {};
}

Result<void> Ingress::Subscribe(wire::Bus& bus) {
  wire::SubscriptionEvents session_events;
  session_events.liveliness = [this](ClientId client, NameId robot_id, bool alive) {
    Push(ClientLiveliness{client, robot_id, alive});
  };
  // Streams come first: once a robot learns that its session is open, its scans must arrive.
  if (auto added = Add<ScanSample>(bus, &Ingress::Take); !added) return added;
  if (auto added = Add<OdometrySample>(bus, &Ingress::Take); !added) return added;
  if (auto added = Add<Request>(bus, &Ingress::Take); !added) return added;
  if (auto added = Add<Command>(bus, &Ingress::Take); !added) return added;
  return Add<SessionRequest>(bus, &Ingress::Take, std::move(session_events));
}

void Ingress::Take(SessionRequest&& request) {
  SessionRefusal busy{{.robot_id = HashName(request.robot),
                       .client = request.client,
                       .robot = request.robot,
                       .site = request.site,
                       .phase = SessionPhase::kRefused,
                       .status = {StatusCode::kResourceExhausted, "the server is busy; try again"},
                       .session = request.session}};
  if (inbound_.TryPush(std::move(request))) return;
  overflow_.fetch_add(1, std::memory_order_relaxed);
  outbound_.Send(std::move(busy));
}

void Ingress::Take(ScanSample&& sample) {
  Push(Admit(std::move(sample), std::chrono::steady_clock::now()));
}

void Ingress::Take(OdometrySample&& sample) {
  Push(Admit(std::move(sample)));
}

// Permissions are given by topic. A command on the other topic may come from somebody who may only ask.
void Ingress::Take(Request&& request) {
  if (!IsCommand(request.kind)) return Ask(std::move(request));
  commands_refused_.fetch_add(1, std::memory_order_relaxed);
  Reply reply;
  reply.client = request.client;
  reply.sequence = request.sequence;
  reply.status = {StatusCode::kPermissionDenied,
                  std::string(RequestKindName(request.kind)) + " is a command: send it on the topic cairn/v1/command"};
  outbound_.Send(std::move(reply));
}

void Ingress::Take(Command&& command) {
  Ask(std::move(command.request));
}

void Ingress::Ask(Request&& request) {
  Reply busy;
  busy.client = request.client;
  busy.sequence = request.sequence;
  if (inbound_.TryPush(std::move(request))) return;
  overflow_.fetch_add(1, std::memory_order_relaxed);
  busy.status = {StatusCode::kResourceExhausted, "the server is busy; try again later"};
  outbound_.Send(std::move(busy));
}

void Ingress::Push(InboundValue&& value) {
  if (!inbound_.TryPush(std::move(value))) overflow_.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace cairn::server
