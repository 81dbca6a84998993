#include "server/maps/layer_sum.h"

namespace cairn::server {

slam::GridChunk UnseenChunk() {
  slam::GridChunk chunk;
  chunk.log_odds.fill(slam::kUnseen);
  return chunk;
}

}  // namespace cairn::server
