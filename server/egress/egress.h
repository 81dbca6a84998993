// Publishes the server's values on DDS. Each outbound lane has its own thread, so that a client that reads a
// large answer slowly delays neither poses nor tiles. A value that the middleware does not accept within its
// bounded blocking time is counted and dropped; the room that sent it is not told. Thread rule: Open starts
// the threads; Finish (after Outbound::Close) returns when each remaining value has been published or
// dropped.
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
  // REQUIRES: Finish or Outbound::Close was called.
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
  std::vector<std::jthread> threads_;  // The last member, because the threads use the members above.
};

}  // namespace cairn::server
