#include "server/maps/joint_map.h"

#include <algorithm>
#include <utility>

#include "server/maps/grid_agreement.h"

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

slam::OccupancyGrid::Chunks JointMap::DrawnBefore(SessionId session) const {
  constexpr int kAround = 2;  // Chunks.
  std::set<slam::ChunkKey> area;
  for (const auto& [key, layers] : chunks_) {
    if (!layers.contains(session)) continue;
    for (int dy = -kAround; dy <= kAround; ++dy)
      for (int dx = -kAround; dx <= kAround; ++dx) area.insert({key.x + dx, key.y + dy});
  }
  std::map<SessionId, slam::OccupancyGrid::Chunks> grids;
  for (const slam::ChunkKey& key : area) {
    const auto layers = chunks_.find(key);
    if (layers == chunks_.end()) continue;
    for (const auto& [other, chunk] : layers->second)
      if (other < session && !hidden_.contains(other)) grids[other].emplace(key, chunk);
  }
  std::vector<const slam::OccupancyGrid::Chunks*> summed;
  summed.reserve(grids.size());
  for (const auto& [other, grid] : grids) summed.push_back(&grid);
  return SumOfGrids(summed);
}

void JointMap::SetHidden(SessionId session, bool hidden) {
  const bool changed = hidden ? hidden_.insert(session).second : hidden_.erase(session) > 0;
  if (!changed) return;
  for (const auto& [key, layers] : chunks_) {
    if (layers.contains(session)) dirty_.insert(key);
  }
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
  std::vector<const slam::GridChunk*> shown;
  for (const auto& [session, chunk] : found->second) {
    if (!hidden_.contains(session)) shown.push_back(chunk.get());
  }
  auto cells = std::make_shared<TileCells>();
  for (std::size_t i = 0; i < cells->size(); ++i) {
    int sum = 0;
    bool seen = false;
    for (const slam::GridChunk* const chunk : shown) {
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
