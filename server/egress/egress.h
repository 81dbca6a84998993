// The DDS door outwards: one thread per outbound lane takes plain values and publishes them, so that a client that
// reads a large answer slowly delays neither poses nor tiles. A value the middleware does not take within its bounded
// blocking time is counted and left behind. Thread rule: Open starts the threads; Finish (after Outbound::Close)
// returns when everything left is published or not taken.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "common/status.h"
#include "common/wire/bus.h"
#include "server/outbound.h"

namespace cairn::server {

class Egress {
 public:
  [[nodiscard]] static Result<std::unique_ptr<Egress>> Open(wire::Bus& bus, Outbound& outbound);
  // REQUIRES: Finish was called, or Outbound::Close.
  ~Egress();

  void Finish();
  [[nodiscard]] std::uint64_t unpublished() const { return unpublished_.load(std::memory_order_relaxed); }

 private:
  struct Publications;

  Egress(Outbound& outbound, std::unique_ptr<Publications> publications);
  void Run(BoundedChannel<OutboundValue>& lane);

  Outbound& outbound_;
  const std::unique_ptr<Publications> publications_;
  std::atomic<std::uint64_t> unpublished_{0};
  std::vector<std::jthread> threads_;  // Last: they use everything above.
};

}  // namespace cairn::server
