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
  if (kind == MapEditKind::kKeepOut) return std::nullopt;
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
