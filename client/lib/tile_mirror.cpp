#include "client/lib/tile_mirror.h"

#include <algorithm>
#include <utility>

namespace cairn::client {

bool TileMirror::Enter(Generation generation, std::uint32_t epoch) {
  if (generation < generation_ || (generation == generation_ && epoch < epoch_)) return false;
  if (generation > generation_) info_.reset();
  if (generation > generation_ || epoch > epoch_) {
    generation_ = generation;
    epoch_ = epoch;
    version_ = 0;
    ++emptied_;
    entries_.clear();
  }
  return true;
}

bool TileMirror::Apply(MapInfo&& info) {
  if (info.site_id != site_id_ || !Enter(info.generation, info.epoch)) return false;
  if (info_ && info_->epoch == info.epoch && info.version < info_->version) return false;
  info_ = std::move(info);
  return true;
}

bool TileMirror::Apply(TileSample&& sample) {
  Tile& tile = sample.tile;
  if (sample.site_id != site_id_ || !Enter(sample.generation, tile.epoch)) return false;
  const auto known = entries_.find(tile.key);
  if (known == entries_.end() && entries_.size() >= kMaxTiles) {
    ++ignored_;
    return false;
  }
  version_ = std::max(version_, tile.version);  // Also of a tile that was filled in before.
  if (known != entries_.end() && tile.version <= known->second.version) return false;
  Entry& entry = entries_[tile.key];
  entry.version = tile.version;
  entry.arrived = ++arrivals_;
  if (sample.deleted) {
    entry.tile.reset();
  } else {
    entry.tile = std::move(tile);
  }
  return true;
}

bool TileMirror::Fill(Generation generation, Tile&& tile) {
  if (!Enter(generation, tile.epoch) || entries_.count(tile.key) > 0 || entries_.size() >= kMaxTiles) return false;
  Entry& entry = entries_[tile.key];
  entry.version = tile.version;
  entry.arrived = ++arrivals_;
  entry.tile = std::move(tile);
  return true;
}

bool TileMirror::complete() const {
  if (!info_ || info_->epoch != epoch_ || version_ < info_->version) return false;
  const auto level0 = std::count_if(entries_.begin(), entries_.end(),
                                    [](const auto& e) { return e.first.level == 0 && e.second.tile.has_value(); });
  return static_cast<std::uint64_t>(level0) >= info_->tile_count;
}

std::vector<Tile> TileMirror::tiles() const {
  std::vector<Tile> tiles;
  for (const auto& [key, entry] : entries_) {
    if (entry.tile) tiles.push_back(*entry.tile);
  }
  return tiles;
}

std::vector<Tile> TileMirror::tiles(int level) const {
  std::vector<Tile> tiles;
  for (const auto& [key, entry] : entries_) {
    if (entry.tile && key.level == level) tiles.push_back(*entry.tile);
  }
  return tiles;
}

std::optional<Tile> TileMirror::tile(const TileKey& key) const {
  const auto found = entries_.find(key);
  return found == entries_.end() ? std::nullopt : found->second.tile;
}

TileChanges TileMirror::ChangesSince(const TileChanges::Place& place) const {
  TileChanges changes;
  changes.now = {.mirror = place.mirror, .emptied = emptied_, .arrivals = arrivals_};
  changes.whole = place.emptied != emptied_ || place.arrivals > arrivals_;
  const std::uint64_t since = changes.whole ? 0 : place.arrivals;
  if (since == arrivals_) return changes;
  for (const auto& [key, entry] : entries_) {
    if (entry.arrived <= since || (changes.whole && !entry.tile)) continue;
    changes.changed.push_back({.key = key, .version = entry.version, .removed = !entry.tile});
  }
  return changes;
}

}  // namespace cairn::client
