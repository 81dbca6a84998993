// Publishes the server's values on DDS. Each outbound lane has its own thread, so that a client that reads a
// large answer slowly delays neither poses nor tiles. A value that the middleware does not accept within its
// bounded blocking time is counted; a state is kept and published again every kRetryPeriod, in its newest form, and any
// other value is dropped. Every value gets the server's generation here.
// Thread rule: Open starts the threads; Finish (after Outbound::Close) returns when each remaining value has been
// published or dropped.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "common/service/generation.h"
#include "common/status.h"
#include "common/wire/bus.h"
#include "server/outbound.h"

namespace cairn::server {

class Egress {
 public:
  static constexpr std::chrono::milliseconds kRetryPeriod{100};

  [[nodiscard]] static Result<std::unique_ptr<Egress>> Open(wire::Bus& bus, Outbound& outbound, Generation generation);
  // REQUIRES: Finish or Outbound::Close was called.
  ~Egress();

  void Finish();
  [[nodiscard]] std::uint64_t unpublished() const { return unpublished_.load(std::memory_order_relaxed); }

 private:
  struct Publications;

  class Door;

  Egress(Outbound& outbound, std::unique_ptr<Publications> publications, Generation generation);
  void Run(BoundedChannel<OutboundValue>& lane);

  Outbound& outbound_;
  const Generation generation_;
  const std::unique_ptr<Publications> publications_;
  std::atomic<std::uint64_t> unpublished_{0};
  std::vector<std::jthread> threads_;  // The last member, because the threads use the members above.
};

}  // namespace cairn::server
