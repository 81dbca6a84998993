// Keeps the states that DDS did not accept, each in its newest form, until they can be sent again. Poses, refusals and
// replies are not states and are not kept: the next pose follows, and clients repeat their requests. At most kMax
// states are kept. Not thread-safe: one owner.
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

  // The key of a state on the wire: the index of its type in OutboundValue, and at most 16 bytes. A retired state has
  // the key that it had before. Empty for values that are not states.
  using Key = std::tuple<std::size_t, std::uint64_t, std::uint64_t>;
  [[nodiscard]] static std::optional<Key> KeyOf(const OutboundValue& value);

  // Keeps a value that was not accepted. Returns false if it is not kept.
  bool Keep(OutboundValue&& value);
  // Removes the kept form, because a newer one is being sent.
  void Forget(const OutboundValue& value);
  // The kept state after this key, in the order of the keys. With it a caller can go through all states while they
  // change.
  [[nodiscard]] std::optional<OutboundValue> After(const std::optional<Key>& key) const;
  [[nodiscard]] bool empty() const { return values_.empty(); }
  [[nodiscard]] std::size_t size() const { return values_.size(); }

 private:
  std::map<Key, OutboundValue> values_;
};

}  // namespace cairn::server
