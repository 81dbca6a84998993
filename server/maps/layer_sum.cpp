#include "server/maps/layer_sum.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace cairn::server {
namespace {

constexpr int kLargest = 32000;  // Of a sum.

}  // namespace

void AddLater(slam::GridChunk& sum, const slam::GridChunk& later, int most) {
  for (std::size_t i = 0; i < sum.log_odds.size(); ++i) {
    const int a = sum.log_odds[i], b = later.log_odds[i];
    if (b == slam::kUnseen) continue;
    const int both = std::clamp(a, -most, most) + b;
    sum.log_odds[i] = static_cast<std::int16_t>(a == slam::kUnseen ? b : std::clamp(both, -kLargest, kLargest));
  }
}

void AddBeside(slam::GridChunk& sum, const slam::GridChunk& other) {
  AddLater(sum, other, kLargest);
}

slam::GridChunk UnseenChunk() {
  slam::GridChunk chunk;
  chunk.log_odds.fill(slam::kUnseen);
  return chunk;
}

}  // namespace cairn::server
