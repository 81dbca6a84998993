#include "server/maps/localising_tiles.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "server/maps/map_edits.h"
#include "server/maps/tile_encoding.h"

namespace cairn::server {
namespace {

// What the edit says for lidars.
std::optional<std::uint8_t> CellSeenOf(MapEditKind kind) {
  if (kind == MapEditKind::kKeepOut || kind == MapEditKind::kOrigin) return std::nullopt;
  return kind == MapEditKind::kFree ? std::uint8_t{0} : kUnknownCell;
}

// Edits again, in their order, over the tiles that have walls.
EditOverlay OverlayWithoutWalls(const std::vector<MapEdit>& edits, double resolution_m) {
  std::set<slam::ChunkKey> walls;
  for (const MapEdit& edit : edits) {
    if (edit.kind == MapEditKind::kOccupied) walls.merge(TilesOf(edit, resolution_m));
  }
  EditOverlay overlay;
  if (walls.empty()) return overlay;
  // The site has no more tiles of edits than may be.
  for (const MapEdit& edit : edits)
    static_cast<void>(DrawEdit(edit, CellSeenOf(edit.kind), resolution_m, &walls, overlay));
  return overlay;
}

}  // namespace

std::vector<TileSet::TilePtr> TilesNear(std::span<const TileSet::TilePtr> tiles, double resolution_m,
                                        const Eigen::Vector2d& p_map, double reach_m) {
  const double side_m = resolution_m * kTileCells;
  const auto is_near = [&](std::int32_t tile, double at_m) {
    return (tile + 1) * side_m >= at_m - reach_m && tile * side_m <= at_m + reach_m;
  };
  std::vector<TileSet::TilePtr> near;
  for (const TileSet::TilePtr& tile : tiles)
    if (is_near(tile->key.x, p_map.x()) && is_near(tile->key.y, p_map.y())) near.push_back(tile);
  return near;
}

std::shared_ptr<const slam::KnownGrid> KnownGridOf(std::span<const TileSet::TilePtr> tiles, double resolution_m,
                                                   std::uint32_t epoch, const slam::PlaceSearchOptions& options,
                                                   double near_m, SharedKnownGrids* shared) {
  slam::KnownGrid::Source source{{}, resolution_m, epoch};
  for (const TileSet::TilePtr& tile : tiles) {
    if (auto cells = DecodeCells(tile->bytes, tile->encoding))
      source.tiles.emplace(slam::ChunkKey{tile->key.x, tile->key.y},
                           std::make_shared<const TileCells>(std::move(*cells)));
  }
  if (!slam::KnownGrid::IsBounded(source)) return nullptr;
  if (shared != nullptr) return shared->Make(std::move(source), options, near_m);
  return std::make_shared<const slam::KnownGrid>(std::move(source), options, near_m);
}

bool IsSmallEnoughToLocaliseIn(const MapSnapshot& map) {
  const auto box = map.tiles.BoxOf(0);
  const double side_m = map.info.resolution_m * kTileCells;
  return !box || (std::max(box->x_max - box->x_min, box->y_max - box->y_min) + 1) * side_m <= slam::KnownGrid::kMostM;
}

std::vector<TileSet::TilePtr> TilesToLocaliseIn(const MapSnapshot& map) {
  const EditOverlay overlay = OverlayWithoutWalls(*map.edits, map.info.resolution_m);
  std::vector<TileSet::TilePtr> tiles;
  map.tiles.ForEach(0, [&](const TileSet::TilePtr& tile) {
    const auto over = overlay.find({tile->key.x, tile->key.y});
    auto cells = over == overlay.end() ? Result<TileCells>(Fail(StatusCode::kNotFound, "no edit"))
                                       : DecodeCells(tile->bytes, tile->encoding);
    if (cells) DrawOver(*over->second, *cells);
    tiles.push_back(cells ? EncodeTile(tile->key, *cells, tile->epoch, tile->version) : tile);
  });
  return tiles;
}

}  // namespace cairn::server
