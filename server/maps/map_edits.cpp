#include "server/maps/map_edits.h"

#include <algorithm>
#include <string>
#include <utility>

#include "server/store/records.h"

namespace cairn::server {
namespace {

constexpr std::uint8_t kFreeCell = 0, kOccupiedCell = 100;

std::optional<std::uint8_t> CellOf(MapEditKind kind) {
  switch (kind) {
    case MapEditKind::kFree:
      return kFreeCell;
    case MapEditKind::kUnknown:
      return kUnknownCell;
    case MapEditKind::kOccupied:
      return kOccupiedCell;
    case MapEditKind::kKeepOut:
    case MapEditKind::kOrigin:
      break;
  }
  return std::nullopt;
}

// Calls `act` with each part of the edit that lies in one row of one tile: the tile, and the indices of the part's
// first cell and of the one after its last. Ends where that returns false.
template <typename Act>
bool ForEachPart(const MapEdit& edit, double resolution_m, const Act& act) {
  for (const CellRun& run : CellsOf(edit, resolution_m)) {
    const int row = FloorDiv(run.y, kTileCells);
    for (int x = run.x_first; x <= run.x_last;) {
      const int column = FloorDiv(x, kTileCells);
      const int end = std::min(run.x_last + 1, (column + 1) * kTileCells);
      const int before = (run.y - row * kTileCells) * kTileCells - column * kTileCells;
      if (!act(slam::ChunkKey{column, row}, before + x, before + end)) return false;
      x = end;
    }
  }
  return true;
}

}  // namespace

bool DrawEdit(const MapEdit& edit, std::optional<std::uint8_t> cell, double resolution_m,
              const std::set<slam::ChunkKey>* only, EditOverlay& overlay) {
  if (!cell) return true;
  std::map<slam::ChunkKey, std::shared_ptr<TileCells>> changed;
  std::size_t tiles = overlay.size();
  const bool fits = ForEachPart(edit, resolution_m, [&](const slam::ChunkKey& key, int first, int end) {
    if (only != nullptr && !only->contains(key)) return true;
    std::shared_ptr<TileCells>& place = changed[key];
    if (place == nullptr) {
      const auto known = overlay.find(key);
      if (known == overlay.end() && ++tiles > kMostOverlayTiles) return false;
      place = std::make_shared<TileCells>();
      if (known == overlay.end()) {
        place->fill(kAsDrawn);
      } else {
        *place = *known->second;
      }
    }
    std::fill(place->begin() + first, place->begin() + end, *cell);
    return true;
  });
  if (!fits) return false;
  for (auto& [key, cells] : changed) overlay.insert_or_assign(key, std::move(cells));
  return true;
}

std::set<slam::ChunkKey> TilesOf(const MapEdit& edit, double resolution_m) {
  std::set<slam::ChunkKey> tiles;
  ForEachPart(edit, resolution_m, [&tiles](const slam::ChunkKey& key, int, int) {
    tiles.insert(key);
    return true;
  });
  return tiles;
}

void DrawOver(const TileCells& overlay, TileCells& cells) {
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (overlay[i] != kAsDrawn) cells[i] = overlay[i];
  }
}

MapEdits::MapEdits(double resolution_m, std::size_t most) : resolution_m_(resolution_m), most_(most) {}

Result<std::uint64_t> MapEdits::Add(MapEdit edit, EditAnchors anchors) {
  if (auto valid = ValidateMapEdit(edit); !valid) return tl::unexpected(valid.error());
  if (all_->size() >= most_) {
    return Fail(StatusCode::kResourceExhausted,
                "the map has " + std::to_string(most_) + " edits; the limit is maps.max_edits");
  }
  // Each edit that is there may still be removed, which takes a number as well.
  if (version_ + all_->size() + 2 >= kMaxEditsVersion)
    return Fail(StatusCode::kResourceExhausted, "the numbers of the map's edits are used up");
  edit.id = version_ + 1;
  auto more = std::make_shared<std::vector<MapEdit>>(*all_);
  more->push_back(edit);
  if (!DrawEdit(edit, CellOf(edit.kind), resolution_m_, nullptr, overlay_)) {
    return Fail(StatusCode::kResourceExhausted,
                "the edits of the map would cover more than " + std::to_string(kMostOverlayTiles) + " tiles");
  }
  all_ = std::move(more);
  anchors_[edit.id] = std::move(anchors);
  return ++version_;
}

Result<void> MapEdits::Remove(std::uint64_t id) {
  auto fewer = std::make_shared<std::vector<MapEdit>>(*all_);
  const auto gone = std::ranges::find(*fewer, id, &MapEdit::id);
  if (gone == fewer->end()) return Fail(StatusCode::kNotFound, "the map has no edit " + std::to_string(id));
  if (CellOf(gone->kind)) {
    const std::set<slam::ChunkKey> tiles = TilesOf(*gone, resolution_m_);
    fewer->erase(gone);
    if (auto overlay = Redrawn(*fewer, tiles)) overlay_ = *std::move(overlay);  // There are no more tiles than before.
  } else {
    fewer->erase(gone);
  }
  all_ = std::move(fewer);
  anchors_.erase(id);
  ++version_;
  return {};
}

std::optional<EditOverlay> MapEdits::Redrawn(const std::vector<MapEdit>& edits,
                                             const std::set<slam::ChunkKey>& tiles) const {
  EditOverlay overlay = overlay_;
  for (const slam::ChunkKey& key : tiles) overlay.erase(key);
  for (const MapEdit& edit : edits)
    if (!DrawEdit(edit, CellOf(edit.kind), resolution_m_, &tiles, overlay)) return std::nullopt;
  return overlay;
}

bool MapEdits::AnchorAgain(const std::function<bool(const EditAnchors&)>& is_lost, const Anchoring& anchors_of) {
  bool changed = false;
  for (const MapEdit& edit : *all_) {
    EditAnchors& anchors = anchors_[edit.id];
    if (!is_lost(anchors)) continue;
    auto again = anchors_of(edit);
    if (!again) continue;
    anchors = *std::move(again);
    changed = true;
  }
  return changed;
}

bool MapEdits::Follow(const DrawnPaths& paths) {
  constexpr double kRounding_m = 1e-6;
  std::vector<MapEdit> all = *all_;
  std::set<slam::ChunkKey> tiles;
  bool moved = false;
  for (MapEdit& edit : all) {
    EditAnchors& anchors = anchors_[edit.id];
    bool changed = false;
    for (EditAnchor& one : anchors.keyframes) {
      const auto drawn = paths.find(one.session);
      const Pose2* const now = drawn == paths.end() ? nullptr : drawn->second.Find(one.keyframe);
      if (now == nullptr || *now == one.T_map_now) continue;
      one.T_map_now = *now;
      changed = true;
    }
    if (!changed) continue;
    MapEdit there = edit;
    there.points_map = anchors.points_then;
    there = Moved(there, MotionOf(anchors));
    const bool stays = std::ranges::equal(there.points_map, edit.points_map,
                                          [](const auto& a, const auto& b) { return (a - b).norm() <= kRounding_m; });
    if (stays || !ValidateMapEdit(there)) continue;
    if (CellOf(edit.kind)) {
      tiles.merge(TilesOf(edit, resolution_m_));
      tiles.merge(TilesOf(there, resolution_m_));
    }
    edit = std::move(there);
    moved = true;
  }
  // Each edit may still be removed, which takes a number as well.
  if (!moved || version_ + all.size() + 2 >= kMaxEditsVersion) return false;
  auto overlay = Redrawn(all, tiles);
  if (!overlay) return false;
  overlay_ = *std::move(overlay);
  all_ = std::make_shared<std::vector<MapEdit>>(std::move(all));
  ++version_;
  return true;
}

std::size_t MapEdits::Restore(std::vector<MapEdit> all, std::uint64_t version, const std::function<void()>& advance,
                              std::map<std::uint64_t, EditAnchors> anchors) {
  EditOverlay overlay;
  const std::size_t left_out = std::erase_if(all, [&](const MapEdit& edit) {
    advance();
    return !DrawEdit(edit, CellOf(edit.kind), resolution_m_, nullptr, overlay);
  });
  overlay_ = std::move(overlay);
  all_ = std::make_shared<std::vector<MapEdit>>(std::move(all));
  version_ = version;
  anchors_ = std::move(anchors);
  return left_out;
}

void MapEdits::Clear() {
  all_ = std::make_shared<std::vector<MapEdit>>();
  overlay_.clear();
  anchors_.clear();
  ++version_;
}

}  // namespace cairn::server
