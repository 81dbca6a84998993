// Limits how often one person is told of changed tiles: of each tile at most once in kPeriod. The first change is told
// at once; of those that come sooner, the newest is told when the time has come, so that the last one is never lost.
// Bounded by the tiles of the map. Not thread-safe.
#pragma once

#include <chrono>
#include <map>

#include "client/lib/tile_mirror.h"

namespace cairn::web {

class TilePacer {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kPeriod{1};

  // `changes`: what has changed since the last call. Returns what may be told at `now`, which may also be of earlier
  // calls. A whole map is told at once, and what waited is forgotten, because it belongs to the map before.
  // REQUIRES: `now` does not go back.
  [[nodiscard]] client::TileChanges Next(const client::TileChanges& changes, Clock::time_point now);

 private:
  std::map<TileKey, Clock::time_point> told_;  // The tiles that were told less than kPeriod ago.
  std::map<TileKey, client::TileChanges::Change> waiting_;
};

}  // namespace cairn::web
