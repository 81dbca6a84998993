// Encodes the cells of a tile for publication: as PNG, or as raw bytes if PNG is not smaller. Stateless,
// thread-safe.
#pragma once

#include <memory>

#include "common/map/tile.h"

namespace cairn::server {

[[nodiscard]] std::shared_ptr<const Tile> EncodeTile(TileKey key, const TileCells& cells, std::uint32_t epoch,
                                                     std::uint64_t version);

// The same bytes under another epoch and version.
[[nodiscard]] std::shared_ptr<const Tile> Restamp(const Tile& tile, std::uint32_t epoch, std::uint64_t version);

}  // namespace cairn::server
