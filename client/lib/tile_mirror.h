// The tiles of one site as the server has them, built from the map and tile topics in whatever order they come:
// - a tile of a higher version replaces the whole tile, one of a lower or equal version is ignored;
// - a tombstone removes the tile, and is remembered so that no late older tile brings it back;
// - the first value of a higher epoch, from either topic, removes every tile of the epochs before;
// - the first value of a higher generation of the server removes everything, because epochs and versions begin anew.
// So all its tiles are always of one generation and one epoch. Pure value; not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "common/map/tile.h"
#include "common/service/map_info.h"
#include "common/service/stream.h"

namespace cairn::client {

// What changed in a mirror since a reader last looked. A reader keeps `now`, which no one else changes.
struct TileChanges {
  struct Place {
    std::uint64_t mirror = 0;  // Which mirror, and how often it was emptied: otherwise everything has changed.
    std::uint64_t emptied = 0;
    std::uint64_t arrivals = 0;  // Tiles do not arrive in the order of their versions.
    bool operator==(const Place&) const = default;
  };
  struct Change {
    TileKey key;
    std::uint64_t version = 0;
    bool removed = false;
  };
  Place now;
  bool whole = false;  // `changed` is the whole map: what the reader had before is void.
  std::vector<Change> changed;
};

class TileMirror {
 public:
  static constexpr std::size_t kMaxTiles = 262144;  // Tiles of all levels; further ones are ignored and counted.

  explicit TileMirror(NameId site_id) : site_id_(site_id) {}

  // True if it changed the mirror. Other sites' values are ignored.
  bool Apply(MapInfo&& info);
  bool Apply(TileSample&& sample);
  // A tile from the answer to a question, for those who cannot wait until the wire brings it. Only where nothing of
  // that tile is here yet; version() counts only what the wire has brought.
  bool Fill(Generation generation, Tile&& tile);

  // Everything the last map info announces is here.
  [[nodiscard]] bool complete() const;
  [[nodiscard]] Generation generation() const { return generation_; }
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  [[nodiscard]] std::uint64_t version() const { return version_; }  // Highest of the tiles that came.
  [[nodiscard]] const std::optional<MapInfo>& info() const { return info_; }
  [[nodiscard]] std::vector<Tile> tiles() const;  // By key.
  [[nodiscard]] std::vector<Tile> tiles(int level) const;
  [[nodiscard]] std::optional<Tile> tile(const TileKey& key) const;
  [[nodiscard]] TileChanges ChangesSince(const TileChanges::Place& place) const;
  [[nodiscard]] std::uint64_t ignored() const { return ignored_; }

 private:
  struct Entry {
    std::uint64_t version = 0;
    std::uint64_t arrived = 0;
    std::optional<Tile> tile;  // Empty if the tile was removed.
  };
  // False if the generation or the epoch is void.
  bool Enter(Generation generation, std::uint32_t epoch);

  const NameId site_id_;
  Generation generation_ = 0;
  std::uint32_t epoch_ = 0;
  std::uint64_t version_ = 0;
  std::uint64_t emptied_ = 0;
  std::uint64_t arrivals_ = 0;
  std::optional<MapInfo> info_;
  std::map<TileKey, Entry> entries_;
  std::uint64_t ignored_ = 0;
};

}  // namespace cairn::client
