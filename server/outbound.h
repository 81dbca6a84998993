// The values that the rooms of the server send to clients, in bounded lanes. There is no other way out.
// Three lanes, so that a large answer or a whole map never delays a pose: `live` (session states, refusals, poses,
// ledgers, jobs), `map` (map info, tiles), `replies`. Overflow rule: Send never waits and returns false if its lane
// is full. The owner of a state (session, ledger, map, tile, job) then marks it as unsent and sends its newest form
// later; a lost pose is replaced by the next one; if a reply is lost, its client's deadline passes. Once Send has
// accepted a value, the egress is responsible for it: it sends a state again that DDS did not accept. Every refusal is
// counted, also that of a state which is sent later. Thread rule: any thread.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <utility>
#include <variant>

#include "common/bounded_channel.h"
#include "common/service/request.h"
#include "common/service/stream.h"

namespace cairn::server {

// The object that the keys of `of` name no longer exists. Nothing is sent under these keys until it exists again.
struct Retired {
  std::variant<SessionState, PoseReport, Ledger, Job, MapInfo> of;
};

using OutboundValue =
    std::variant<SessionState, SessionRefusal, PoseReport, Ledger, Job, Retired, MapInfo, TileSample, Reply>;

class Outbound {
 public:
  enum class Lane { kLive = 0, kMap, kReplies };
  static constexpr int kLanes = 3;

  explicit Outbound(std::size_t capacity_per_lane);

  // `watcher` sees every value that is sent from now on, also one that finds no room: a state is then sent again, so it
  // may see one twice. A value for which it returns true is for the watcher only, and goes no further. It must not wait
  // or throw. REQUIRES: nothing was sent yet.
  void Watch(std::function<bool(const OutboundValue&)> watcher) { watcher_ = std::move(watcher); }

  bool Send(OutboundValue value);
  // As Send, but waits for room until Close: only for the thread that answers queries, whose own queue then fills and
  // refuses. The door's reader always moves on (its writes have a bounded blocking time).
  bool SendPatiently(OutboundValue value);
  // How many values wait in all lanes.
  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] std::uint64_t refused() const { return refused_.load(std::memory_order_relaxed); }
  // Sessions and requests that were answered RESOURCE_EXHAUSTED.
  [[nodiscard]] std::uint64_t over_limit() const { return over_limit_.load(std::memory_order_relaxed); }

  // The door's side: one reader per lane.
  [[nodiscard]] BoundedChannel<OutboundValue>& lane(Lane lane) { return lanes_[static_cast<std::size_t>(lane)]; }
  // No more sending; readers get what is left, then the end.
  void Close();

 private:
  static Lane LaneOf(const OutboundValue& value);
  // Whether the value has reached the only one it is for.
  bool See(const OutboundValue& value);

  std::function<bool(const OutboundValue&)> watcher_;
  std::array<BoundedChannel<OutboundValue>, kLanes> lanes_;
  std::atomic<std::uint64_t> refused_{0}, over_limit_{0};
};

}  // namespace cairn::server
