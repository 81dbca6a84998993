// Puts the parts of one answer together. Pure value; not thread-safe.
#pragma once

#include <cstdint>
#include <map>

#include "common/service/request.h"

namespace cairn::client {

class ReplyAssembly {
 public:
  // A part, in whatever order. A part seen before is ignored. Parts of two generations are never put together: those of
  // the lower one are dropped.
  void Add(Reply&& part);
  [[nodiscard]] bool complete() const { return last_seen_ && parts_.size() == last_part_ + std::size_t{1}; }
  [[nodiscard]] std::size_t parts() const { return parts_.size(); }
  // All parts as one; the status and versions are those of the last. Lists are in the order of the parts.
  [[nodiscard]] Reply Take();

 private:
  static constexpr std::size_t kMaxParts = 65536;  // A server sends fewer.

  std::map<std::uint32_t, Reply> parts_;
  Generation generation_ = 0;
  bool last_seen_ = false;
  std::uint32_t last_part_ = 0;
};

}  // namespace cairn::client
