// Cuts an answer into parts that fit the wire (less than 64 KB each, idl/README.md). Every part repeats the
// header and the status. Items keep their order. Parts are numbered from 0, and the last one has `last` set.
// An answer without items is one part. Stateless, thread-safe.
#pragma once

#include <cstddef>
#include <vector>

#include "common/service/request.h"

namespace cairn::server {

inline constexpr std::size_t kPartBudgetBytes = 48 * 1024;

[[nodiscard]] std::vector<Reply> SplitReply(Reply&& reply);

}  // namespace cairn::server
