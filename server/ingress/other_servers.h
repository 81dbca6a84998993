// How many other servers answer in this DDS domain: on other machines, or in networks joined later. Two servers both
// take every scan and answer every question, and each knows only a part. (A second server on the same machine is
// refused by ops/domain_lock.) A server is whoever subscribes to requests. Thread rule: one thread.
#pragma once

#include <memory>
#include <utility>

#include "common/wire/bus.h"

namespace cairn::server {

class OtherServers {
 public:
  [[nodiscard]] static Result<std::unique_ptr<OtherServers>> Watch(wire::Bus& bus);
  // Valid after this process itself has subscribed to requests.
  [[nodiscard]] int count() const;
  // Returns whether there are more servers than at the last call.
  [[nodiscard]] bool Joined();

 private:
  explicit OtherServers(std::unique_ptr<wire::Publication<Request>> requests) : requests_(std::move(requests)) {}

  const std::unique_ptr<wire::Publication<Request>> requests_;  // Nothing is ever published on it.
  int known_ = 0;
};

}  // namespace cairn::server
