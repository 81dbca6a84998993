// Follows the poses that the server publishes for one robot. Not a history: it receives only what is published while it
// exists, and where the reader is slow, the oldest waiting poses are dropped. Poses of an earlier generation of the
// server than one seen before are ignored. (QueryClient::Path has all poses.)
// Thread rule: every method from any thread, but Next not from a callback of the wire.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "common/bounded_channel.h"
#include "common/service/pose_report.h"
#include "common/wire/bus.h"

namespace cairn::client {

class PoseClient {
 public:
  static constexpr std::size_t kMaxWaiting = 4096;

  [[nodiscard]] static Result<std::unique_ptr<PoseClient>> Create(wire::Bus& bus, const std::string& robot);

  // The oldest pose that waits, or the next one that arrives; nothing if none arrives within the timeout.
  [[nodiscard]] std::optional<PoseReport> Next(double timeout_s);
  // Poses dropped because kMaxWaiting others were waiting.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

 private:
  explicit PoseClient(const std::string& robot) : robot_id_(HashName(robot)) {}
  void OnPose(PoseReport&& pose);

  const NameId robot_id_;
  BoundedChannel<PoseReport> waiting_{kMaxWaiting};
  std::atomic<std::uint64_t> dropped_ = 0;
  Generation generation_ = 0;                  // Callbacks come one at a time.
  std::unique_ptr<wire::Subscription> poses_;  // Last: its callback uses everything above.
};

}  // namespace cairn::client
