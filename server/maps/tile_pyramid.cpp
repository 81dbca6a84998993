#include "server/maps/tile_pyramid.h"

#include <array>
#include <cstddef>
#include <set>
#include <utility>

namespace cairn::server {

std::vector<TileKey> TilePyramid::Update(const std::map<TileKey, Cells>& finest) {
  std::vector<TileKey> changed;
  std::set<TileKey> below;
  for (const auto& [key, cells] : finest) {
    if (Store(key, cells)) below.insert(key);
  }
  for (int level = 1; !below.empty(); ++level) {
    changed.insert(changed.end(), below.begin(), below.end());
    if (level == kPyramidLevels) break;
    std::set<TileKey> parents, changed_parents;
    for (const TileKey& child : below) parents.insert({level, FloorDiv(child.x, 2), FloorDiv(child.y, 2)});
    for (const TileKey& parent : parents) {
      if (Store(parent, Reduce(parent))) changed_parents.insert(parent);
    }
    below = std::move(changed_parents);
  }
  return changed;
}

bool TilePyramid::Store(TileKey key, Cells cells) {
  const auto found = cells_.find(key);
  if (cells == nullptr) {
    if (found == cells_.end()) return false;
    cells_.erase(found);
    return true;
  }
  if (found != cells_.end() && *found->second == *cells) return false;
  cells_.insert_or_assign(key, std::move(cells));
  return true;
}

TilePyramid::Cells TilePyramid::Reduce(TileKey parent) const {
  std::array<const TileCells*, 4> children{};
  bool any = false;
  for (int i = 0; i < 4; ++i) {
    const auto child = cells_.find({parent.level - 1, 2 * parent.x + i % 2, 2 * parent.y + i / 2});
    if (child == cells_.end()) continue;
    children[static_cast<std::size_t>(i)] = child->second.get();
    any = true;
  }
  return any ? std::make_shared<const TileCells>(ReduceTiles(children)) : nullptr;
}

}  // namespace cairn::server
