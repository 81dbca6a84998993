// The door for robots that run ROS 2: a DDS participant of its own beside the native one, with the same values in and
// out (README.md). Ros2Ingress is its way in, Ros2Egress its way out; Ros2Services answers who asks. Order: Open before
// the server starts (it watches what goes out), Start when the server runs, Close before the server stops, Finish
// after. Thread rule: these from one thread; report and the counts from any.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>

#include "common/service/ros2_report.h"
#include "common/status.h"
#include "common/wire/bus.h"
#include "server/inbound.h"
#include "server/outbound.h"
#include "server/ros2/command_calls.h"
#include "server/ros2/failures.h"
#include "server/ros2/ros2_egress.h"
#include "server/ros2/ros2_ingress.h"
#include "server/ros2/ros2_options.h"
#include "server/ros2/ros2_services.h"

namespace cairn::server {

class Ros2Door {
 public:
  // `wire`: the native network, whose interfaces are used where the options name none.
  [[nodiscard]] static Result<std::unique_ptr<Ros2Door>> Open(const Ros2Options& options, const wire::WireOptions& wire,
                                                              const ServerAbilities& abilities, Inbound& inbound,
                                                              Outbound& outbound);
  ~Ros2Door();

  void Start();
  void Close();
  void Finish();

  [[nodiscard]] Ros2Report report() const;
  // Values that found no room in the inbound channel; samples that were not decoded; messages that were not published.
  [[nodiscard]] std::uint64_t overflow() const { return ingress_.overflow() + services_.overflow(); }
  [[nodiscard]] std::uint64_t malformed() const {
    return ingress_.malformed() + services_.malformed() + failures_.count();
  }
  [[nodiscard]] std::uint64_t unpublished() const {
    return egress_.unpublished() + services_.unanswered() + unseen_.count();
  }
  [[nodiscard]] std::uint64_t datagrams_refused() const { return bus_->datagrams_refused(); }
  [[nodiscard]] std::chrono::nanoseconds busy_with_one_datagram() const { return bus_->busy_with_one_datagram(); }

 private:
  Ros2Door(const Ros2Options& options, NamespaceRules rules, std::unique_ptr<ros2::Bus> bus,
           const ServerAbilities& abilities, Inbound& inbound);
  // Whether the value is for the door only.
  bool See(const OutboundValue& value);

  const Ros2Options options_;
  const std::unique_ptr<ros2::Bus> bus_;
  CommandCalls calls_;  // Of robots and of services.
  Ros2Egress egress_;
  Ros2Ingress ingress_;
  Ros2Services services_;
  Failures failures_{"a message of a ROS 2 robot"};
  Failures unseen_{"a value for ROS 2"};
  std::jthread thread_;  // The last member, because it uses the members above.
};

}  // namespace cairn::server
