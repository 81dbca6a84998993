// The client's side: pieces, each a number and a sample that a server, or whoever pretends to be one, sends. They go
// into the mirror of a site's tiles, into an answer and into the window of scans; then tiles are decoded and put
// together.
#include <cmath>

#include "client/lib/reply_assembly.h"
#include "client/lib/tile_mirror.h"
#include "common/map/occupancy_image.h"
#include "tests/common/wire/sample_values.h"
#include "tests/fuzz/wire_bytes.h"

namespace cairn::fuzz {
namespace {

constexpr NameId kSiteId = 0x1122334455667788;

// Two tiles far from each other make an image of 128 MiB, which is allowed.
bool TakesLong(const std::vector<Tile>& tiles) {
  std::int64_t columns = 1, rows = 1;
  for (const Tile& tile : tiles) {
    columns = std::max(columns, std::abs(std::int64_t{tile.key.x} - tiles[0].key.x));
    rows = std::max(rows, std::abs(std::int64_t{tile.key.y} - tiles[0].key.y));
  }
  constexpr std::int64_t kQuick = 64, kRefused = 1 << 14;
  return columns < kRefused && rows < kRefused && columns * rows > kQuick && columns * rows < kRefused;
}

// What `cairn map` does with tiles.
void UseTiles(const std::vector<Tile>& tiles, double resolution_m) {
  for (const Tile& tile : tiles) {
    const auto cells = DecodeCells(tile.bytes, tile.encoding);
    if (!cells) {
      Must(!cells.error().message.empty(), "a refusal has a reason");
      continue;
    }
    for (const std::uint8_t cell : *cells) Must(cell <= 100 || cell == kUnknownCell, "a cell is a share or unknown");
  }
  if (TakesLong(tiles)) return;
  const auto map = AssembleTiles(tiles, resolution_m);
  if (!map) return Must(!map.error().message.empty(), "a refusal has a reason");
  Must(map->cells.size() == static_cast<std::size_t>(map->width) * static_cast<std::size_t>(map->height),
       "a whole map");
  Must(tiles.empty() || static_cast<std::size_t>(map->width) >= kTileCells, "a tile is on the map");
}

struct Screen {
  client::TileMirror mirror{kSiteId};
  client::ReplyAssembly answer;
  bool accepted = false;

  void Show(TileSample&& sample) {
    const Generation generation = mirror.generation();
    const TileSample sent = sample;
    if (!mirror.Apply(std::move(sample))) return;
    Must(sent.site_id == kSiteId && sent.generation >= generation, "only tiles of this site and of no older server");
    Must(mirror.generation() == sent.generation && mirror.epoch() == sent.tile.epoch, "all tiles are of one epoch");
    Must(mirror.version() >= sent.tile.version, "the mirror's version is that of its newest tile");
  }
  void Show(MapInfo&& info) { static_cast<void>(mirror.Apply(std::move(info))); }
  void Show(Reply&& reply) {
    answer.Add(std::move(reply));
    if (answer.complete()) {
      const Reply whole = answer.Take();
      UseTiles(whole.tiles, 0.05);
      answer = {};
    }
  }
  template <typename Value>
  void Receive(std::string_view bytes) {
    auto value = Received<Value>(bytes);
    if (!value) return;
    accepted = true;
    Show(std::move(*value));
  }
};

bool RunMirror(std::string_view input) {
  Screen screen;
  for (Pieces pieces(input); !pieces.empty();) {
    const std::uint8_t kind = pieces.Take() % 3;
    const std::string_view piece = pieces.TakePiece();
    if (kind == 0) screen.Receive<TileSample>(piece);
    if (kind == 1) screen.Receive<MapInfo>(piece);
    if (kind == 2) screen.Receive<Reply>(piece);
  }
  static_cast<void>(screen.mirror.complete());
  const auto& info = screen.mirror.info();
  UseTiles(screen.mirror.tiles(), info ? info->resolution_m : 0.05);
  UseTiles(screen.mirror.tiles(0), 0.05);
  return screen.accepted;
}

TileSample SampleTile(int x, int y, std::uint64_t version) {
  TileCells cells;
  for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = i / 64 % 3 == 0 ? kUnknownCell : i / 64 % 3 == 1 ? 0 : 100;
  TileSample sample{kSiteId, {}, false, 5};
  sample.tile = {{0, x, y}, 2, version, TileEncoding::kPng, EncodeCells(cells, TileEncoding::kPng)};
  return sample;
}

MapInfo SampleInfo() {
  MapInfo info;
  info.site_id = kSiteId;
  info.site = "lab";
  info.resolution_m = 0.05;
  info.epoch = 2;
  info.version = 9;
  info.tile_count = 2;
  info.generation = 5;
  return info;
}

template <typename Value>
std::string Told(char kind, const Value& value) {
  return std::string(1, kind) + Piece(Serialized(value));
}

std::vector<std::string> SeedsOfServers() {
  TileSample removed = SampleTile(0, 0, 10);
  removed.deleted = true;
  removed.tile.bytes.clear();
  MapInfo later = SampleInfo();
  later.epoch = 3;
  Reply first, second;
  first.generation = second.generation = 5;
  first.last = false;
  first.tiles = {SampleTile(0, 0, 8).tile};
  second.part = 1;
  second.tiles = {SampleTile(-2, 1, 9).tile};
  TileSample bare = SampleTile(3, 3, 11);
  bare.tile.encoding = TileEncoding::kRaw;
  Reply everything = wire::ExtremeReply();
  everything.tiles.resize(1);
  everything.tiles[0].bytes.resize(16);
  everything.part = 0;
  everything.last = true;
  const std::string info = Told(1, SampleInfo()), tiles = Told(0, SampleTile(0, 0, 8)) + Told(0, SampleTile(-2, 1, 9));
  return {info + tiles,
          tiles + Told(0, removed),
          tiles + Told(1, later) + info,
          Told(2, first) + Told(2, second),
          Told(2, second) + Told(2, first),
          info + Told(0, bare),
          Told(2, everything)};
}

const bool kMirrorTarget = Register({"mirror", &RunMirror, &SeedsOfServers});

}  // namespace
}  // namespace cairn::fuzz
