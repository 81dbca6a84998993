// Cuts an answer into parts that fit the wire (< 64 KB each, idl/README.md): every part repeats the header and status,
// items keep their order, parts count from 0 and the one with `last` ends the answer. An answer without items is one
// part. Stateless, thread-safe.
#pragma once

#include <cstddef>
#include <vector>

#include "common/service/request.h"

namespace cairn::server {

inline constexpr std::size_t kPartBudgetBytes = 48 * 1024;

[[nodiscard]] std::vector<Reply> SplitReply(Reply&& reply);

}  // namespace cairn::server
