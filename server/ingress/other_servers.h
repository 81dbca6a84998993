// Whether another server answers in this DDS domain. Two would both take every scan and answer every question, each
// with half the truth. A server is whoever subscribes to requests. Thread rule: one thread.
#pragma once

#include <chrono>
#include <memory>

#include "common/wire/bus.h"

namespace cairn::server {

class OtherServers {
 public:
  [[nodiscard]] static Result<std::unique_ptr<OtherServers>> Watch(wire::Bus& bus);

  // Waits at most this long for one to be discovered. Before this process subscribes to requests itself.
  [[nodiscard]] bool FoundWithin(std::chrono::milliseconds time) const;
  // Once this process subscribes to requests: how many others do.
  [[nodiscard]] int count() const;

 private:
  explicit OtherServers(std::unique_ptr<wire::Publication<Request>> requests) : requests_(std::move(requests)) {}

  const std::unique_ptr<wire::Publication<Request>> requests_;  // Nothing is ever published on it.
};

}  // namespace cairn::server
