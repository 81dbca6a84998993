#include "server/maps/joint_map.h"

#include <algorithm>
#include <utility>

namespace cairn::server {
namespace {

bool AllUnknown(const TileCells& cells) {
  return std::all_of(cells.begin(), cells.end(), [](std::uint8_t cell) { return cell == kUnknownCell; });
}

}  // namespace

void JointMap::Apply(const GridChange& change) {
  for (const auto& [key, chunk] : change.chunks) SetLayer(key, change.session, chunk);
}

void JointMap::Replace(SessionId session, const slam::OccupancyGrid::Chunks& chunks) {
  for (const auto& [key, chunk] : ChunksOf(session)) {
    if (!chunks.contains(key)) SetLayer(key, session, nullptr);
  }
  for (const auto& [key, chunk] : chunks) SetLayer(key, session, chunk);
}

slam::OccupancyGrid::Chunks JointMap::ChunksOf(SessionId session) const {
  slam::OccupancyGrid::Chunks mine;
  for (const auto& [key, layers] : chunks_) {
    const auto layer = layers.find(session);
    if (layer != layers.end()) mine.emplace(key, layer->second);
  }
  return mine;
}

void JointMap::SetLayer(slam::ChunkKey key, SessionId session, std::shared_ptr<const slam::GridChunk> chunk) {
  dirty_.insert(key);
  if (chunk != nullptr) {
    chunks_[key][session] = std::move(chunk);
    return;
  }
  const auto found = chunks_.find(key);
  if (found == chunks_.end()) return;
  found->second.erase(session);
  if (found->second.empty()) chunks_.erase(found);
}

std::vector<TileKey> JointMap::Render() {
  std::vector<TileKey> changed;
  std::set<TileKey> below;
  for (const slam::ChunkKey& key : dirty_) {
    const TileKey tile{0, key.x, key.y};
    if (Store(tile, Sum(key))) below.insert(tile);
  }
  dirty_.clear();
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

bool JointMap::Store(TileKey key, Cells cells) {
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

JointMap::Cells JointMap::Sum(slam::ChunkKey key) const {
  const auto found = chunks_.find(key);
  if (found == chunks_.end()) return nullptr;
  const Layers& layers = found->second;
  auto cells = std::make_shared<TileCells>();
  for (std::size_t i = 0; i < cells->size(); ++i) {
    int sum = 0;
    bool seen = false;
    for (const auto& [session, chunk] : layers) {
      const std::int16_t log_odds = chunk->log_odds[i];
      if (log_odds == slam::kUnseen) continue;
      seen = true;
      sum += log_odds;
    }
    const int clamped = std::clamp<int>(sum, slam::kUnseen + 1, INT16_MAX);
    (*cells)[i] = seen ? slam::OccupancyOf(static_cast<std::int16_t>(clamped)) : kUnknownCell;
  }
  return AllUnknown(*cells) ? nullptr : cells;
}

JointMap::Cells JointMap::Reduce(TileKey parent) const {
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
