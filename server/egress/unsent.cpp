#include "server/egress/unsent.h"

#include <utility>
#include <variant>

namespace cairn::server {
namespace {

using Key = Unsent::Key;

constexpr std::size_t kNoState = SIZE_MAX;

Key IdsOf(const SessionState& state) {
  return {0, state.robot_id, 0};
}
Key IdsOf(const PoseReport& pose) {
  return {1, pose.robot_id, 0};
}
Key IdsOf(const Ledger& ledger) {
  return {2, ledger.robot_id, ledger.sensor_id};
}
Key IdsOf(const Job& job) {
  return {3, job.id, 0};
}
Key IdsOf(const MapInfo& map) {
  return {4, map.site_id, 0};
}
Key IdsOf(const TileSample& sample) {
  const TileKey& key = sample.tile.key;
  const auto bits = [](int coordinate) { return static_cast<std::uint64_t>(static_cast<std::uint16_t>(coordinate)); };
  return {5, sample.site_id, bits(key.level) << 32 | bits(key.x) << 16 | bits(key.y)};
}
Key IdsOf(const SessionRefusal& /*refusal*/) {
  return {kNoState, 0, 0};
}
Key IdsOf(const Reply& /*reply*/) {
  return {kNoState, 0, 0};
}
Key IdsOf(const Retired& retired) {
  return std::visit([](const auto& of) { return IdsOf(of); }, retired.of);
}

}  // namespace

std::optional<Key> Unsent::KeyOf(const OutboundValue& value) {
  if (std::holds_alternative<PoseReport>(value)) return std::nullopt;
  const Key key = std::visit([](const auto& one) { return IdsOf(one); }, value);
  return std::get<0>(key) == kNoState ? std::nullopt : std::optional(key);
}

bool Unsent::Keep(OutboundValue&& value) {
  const std::optional<Key> key = KeyOf(value);
  if (!key || (values_.size() >= kMax && !values_.contains(*key))) return false;
  values_.insert_or_assign(*key, std::move(value));
  return true;
}

void Unsent::Forget(const OutboundValue& value) {
  if (const std::optional<Key> key = KeyOf(value)) values_.erase(*key);
}

std::optional<OutboundValue> Unsent::After(const std::optional<Key>& key) const {
  const auto next = key ? values_.upper_bound(*key) : values_.begin();
  if (next == values_.end()) return std::nullopt;
  return next->second;
}

}  // namespace cairn::server
