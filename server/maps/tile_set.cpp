#include "server/maps/tile_set.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace cairn::server {

TileKey TileSet::BlockOf(TileKey key) {
  return {key.level, FloorDiv(key.x, kBlockSide), FloorDiv(key.y, kBlockSide)};
}

TileSet::TilePtr TileSet::Find(TileKey key) const {
  const auto block = blocks_.find(BlockOf(key));
  if (block == blocks_.end()) return nullptr;
  const auto tile = block->second->tiles.find(key);
  return tile == block->second->tiles.end() ? nullptr : tile->second;
}

TileSet TileSet::With(const std::map<TileKey, TilePtr>& changes) const {
  std::map<TileKey, std::shared_ptr<Block>> changed;
  for (const auto& [key, tile] : changes) {
    std::shared_ptr<Block>& block = changed[BlockOf(key)];
    if (!block) {
      const auto before = blocks_.find(BlockOf(key));
      block = before == blocks_.end() ? std::make_shared<Block>() : std::make_shared<Block>(*before->second);
    }
    if (tile) {
      block->tiles.insert_or_assign(key, tile);
    } else {
      block->tiles.erase(key);
    }
  }
  TileSet after = *this;
  for (auto& [place, block] : changed) {
    if (block->tiles.empty()) {
      after.blocks_.erase(place);
      continue;
    }
    block->box = BoxAround(block->tiles);
    after.blocks_.insert_or_assign(place, std::move(block));
  }
  return after;
}

TileBox TileSet::BoxAround(const std::map<TileKey, TilePtr>& tiles) {
  const TileKey& first = tiles.begin()->first;
  TileBox box{first.x, first.y, first.x, first.y, tiles.size()};
  for (const auto& [key, tile] : tiles) {
    box.x_min = std::min(box.x_min, key.x);
    box.y_min = std::min(box.y_min, key.y);
    box.x_max = std::max(box.x_max, key.x);
    box.y_max = std::max(box.y_max, key.y);
  }
  return box;
}

std::optional<TileBox> TileSet::BoxOf(int level) const {
  std::optional<TileBox> all;
  for (auto block = FirstOf(level); block != blocks_.end() && block->first.level == level; ++block) {
    const TileBox& box = block->second->box;
    if (!all) {
      all = box;
      continue;
    }
    all->x_min = std::min(all->x_min, box.x_min);
    all->y_min = std::min(all->y_min, box.y_min);
    all->x_max = std::max(all->x_max, box.x_max);
    all->y_max = std::max(all->y_max, box.y_max);
    all->count += box.count;
  }
  return all;
}

TileSet::Blocks::const_iterator TileSet::FirstOf(int level) const {
  constexpr int kLowest = std::numeric_limits<int>::min();
  return blocks_.lower_bound({level, kLowest, kLowest});
}

}  // namespace cairn::server
