// The states that DDS did not accept, each in its newest form, until they can be sent again. A pose, a refusal and a
// reply are no states: they are superseded or asked for again. At most kMax states are kept. Not thread-safe: one
// owner.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <tuple>

#include "server/outbound.h"

namespace cairn::server {

class Unsent {
 public:
  static constexpr std::size_t kMax = 65536;

  // What a state is keyed by on the wire: the place in OutboundValue of its type, and at most 16 bytes. A retired state
  // has the key of what it was. Nothing for values that are no states.
  using Key = std::tuple<std::size_t, std::uint64_t, std::uint64_t>;
  [[nodiscard]] static std::optional<Key> KeyOf(const OutboundValue& value);

  // The value was not accepted; false where it is not kept.
  bool Keep(OutboundValue&& value);
  // A newer form of the state is on its way.
  void Forget(const OutboundValue& value);
  // The kept state after this key, in the order of the keys; to walk through all of them while they change.
  [[nodiscard]] std::optional<OutboundValue> After(const std::optional<Key>& key) const;
  [[nodiscard]] bool empty() const { return values_.empty(); }
  [[nodiscard]] std::size_t size() const { return values_.size(); }

 private:
  std::map<Key, OutboundValue> values_;
};

}  // namespace cairn::server
