#include "server/outbound.h"

#include <utility>

namespace cairn::server {

Outbound::Outbound(std::size_t capacity_per_lane)
    : lanes_{BoundedChannel<OutboundValue>(capacity_per_lane), BoundedChannel<OutboundValue>(capacity_per_lane),
             BoundedChannel<OutboundValue>(capacity_per_lane)} {}

bool Outbound::Send(OutboundValue value) {
  if (See(value)) return true;
  const Lane of_value = LaneOf(value);
  if (lane(of_value).TryPush(std::move(value))) return true;
  refused_.fetch_add(1, std::memory_order_relaxed);
  return false;
}

bool Outbound::SendPatiently(OutboundValue value) {
  if (See(value)) return true;
  const Lane of_value = LaneOf(value);
  if (lane(of_value).Push(std::move(value))) return true;
  refused_.fetch_add(1, std::memory_order_relaxed);
  return false;
}

bool Outbound::See(const OutboundValue& value) {
  const auto* const reply = std::get_if<Reply>(&value);
  const auto* const refusal = std::get_if<SessionRefusal>(&value);
  const bool over_limit = (reply != nullptr && reply->status.code == StatusCode::kResourceExhausted) ||
                          (refusal != nullptr && refusal->state.status.code == StatusCode::kResourceExhausted);
  if (over_limit) over_limit_.fetch_add(1, std::memory_order_relaxed);
  return watcher_ && watcher_(value);
}

std::size_t Outbound::size() const {
  std::size_t size = 0;
  for (const auto& lane : lanes_) size += lane.size();
  return size;
}

void Outbound::Close() {
  for (auto& lane : lanes_) lane.Close();
}

Outbound::Lane Outbound::LaneOf(const OutboundValue& value) {
  if (std::holds_alternative<Reply>(value)) return Lane::kReplies;
  if (std::holds_alternative<MapInfo>(value) || std::holds_alternative<TileSample>(value)) return Lane::kMap;
  const auto* const retired = std::get_if<Retired>(&value);  // After what was sent of it before.
  if (retired != nullptr && std::holds_alternative<MapInfo>(retired->of)) return Lane::kMap;
  return Lane::kLive;
}

}  // namespace cairn::server
