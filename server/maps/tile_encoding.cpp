#include "server/maps/tile_encoding.h"

namespace cairn::server {

std::shared_ptr<const Tile> EncodeTile(TileKey key, const TileCells& cells, std::uint32_t epoch,
                                       std::uint64_t version) {
  auto tile = std::make_shared<Tile>();
  tile->key = key;
  tile->epoch = epoch;
  tile->version = version;
  tile->encoding = TileEncoding::kPng;
  tile->bytes = EncodeCells(cells, TileEncoding::kPng);
  if (tile->bytes.size() >= static_cast<std::size_t>(kTileArea)) {
    tile->encoding = TileEncoding::kRaw;
    tile->bytes = EncodeCells(cells, TileEncoding::kRaw);
  }
  return tile;
}

std::shared_ptr<const Tile> Restamp(const Tile& tile, std::uint32_t epoch, std::uint64_t version) {
  auto restamped = std::make_shared<Tile>(tile);
  restamped->epoch = epoch;
  restamped->version = version;
  return restamped;
}

}  // namespace cairn::server
