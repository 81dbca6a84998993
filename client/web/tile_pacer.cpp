#include "client/web/tile_pacer.h"

namespace cairn::web {

client::TileChanges TilePacer::Next(const client::TileChanges& changes, Clock::time_point now) {
  if (changes.whole) {
    told_.clear();
    waiting_.clear();
  }
  std::erase_if(told_, [&](const auto& tile) { return now - tile.second >= kPeriod; });
  for (const auto& change : changes.changed) waiting_[change.key] = change;
  client::TileChanges next{.now = changes.now, .whole = changes.whole, .changed = {}};
  for (auto tile = waiting_.begin(); tile != waiting_.end();) {
    if (!told_.try_emplace(tile->first, now).second) {
      ++tile;
      continue;
    }
    next.changed.push_back(tile->second);
    tile = waiting_.erase(tile);
  }
  return next;
}

}  // namespace cairn::web
