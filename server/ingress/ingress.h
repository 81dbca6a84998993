// Subscribes to what robots and clients send over DDS, validates it, and pushes plain values into the inbound
// channel. Callbacks never wait: when the channel is full, values are dropped and counted, and requests are
// answered RESOURCE_EXHAUSTED. Thread rule: callbacks run on DDS threads. Close returns after the last
// callback; the counts stay readable. Call Close and malformed from one thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/status.h"
#include "common/wire/bus.h"
#include "server/inbound.h"
#include "server/outbound.h"

namespace cairn::server {

class Ingress {
 public:
  [[nodiscard]] static Result<std::unique_ptr<Ingress>> Open(wire::Bus& bus, Inbound& inbound, Outbound& outbound);
  ~Ingress();

  void Close();
  // Values dropped because the channel was full.
  [[nodiscard]] std::uint64_t overflow() const { return overflow_.load(std::memory_order_relaxed); }
  // Commands that were sent on the topic of questions.
  [[nodiscard]] std::uint64_t commands_refused() const { return commands_refused_.load(std::memory_order_relaxed); }
  // Samples dropped because lengths or enums were out of range.
  [[nodiscard]] std::uint64_t malformed() const;

 private:
  Ingress(Inbound& inbound, Outbound& outbound) : inbound_(inbound), outbound_(outbound) {}
  Result<void> Subscribe(wire::Bus& bus);
  template <typename Value>
  Result<void> Add(wire::Bus& bus, void (Ingress::*take)(Value&&), wire::SubscriptionEvents events = {});
  void Take(SessionRequest&& request);
  void Take(ScanSample&& sample);
  void Take(OdometrySample&& sample);
  void Take(Request&& request);
  void Take(Command&& command);
  void Ask(Request&& request);
  void Push(InboundValue&& value);

  Inbound& inbound_;
  Outbound& outbound_;
  std::atomic<std::uint64_t> overflow_{0};
  std::atomic<std::uint64_t> commands_refused_{0};
  std::uint64_t malformed_until_closed_ = 0;
  std::vector<std::unique_ptr<wire::Subscription>> subscriptions_;
};

}  // namespace cairn::server
