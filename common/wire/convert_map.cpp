#include <limits>
#include <utility>

#include "common/wire/convert.h"

namespace cairn::wire {

v1::MapInfo ToWire(const MapInfo& value) {
  v1::MapInfo wire;
  wire.site_id(value.site_id);
  wire.generation(value.generation);
  wire.site(value.site);
  wire.resolution_m(value.resolution_m);
  wire.epoch(value.epoch);
  wire.version(value.version);
  wire.levels(value.levels);
  wire.tile_count(value.tile_count);
  wire.x_min_m(value.x_min_m);
  wire.y_min_m(value.y_min_m);
  wire.x_max_m(value.x_max_m);
  wire.y_max_m(value.y_max_m);
  wire.robots(value.robots);
  wire.enabled_version(value.enabled_version);
  for (const MapVersionInfo& version : value.versions) {
    v1::MapVersion& out = wire.versions().emplace_back();
    out.version(version.version);
    out.enabled(version.enabled);
    out.job(version.job);
    out.note(version.note);
  }
  wire.edits_version(value.edits_version);
  wire.memory_bytes(value.memory_bytes);
  wire.memory_note(value.memory_note);
  return wire;
}

MapInfo FromWire(v1::MapInfo&& wire) {
  MapInfo value;
  value.site_id = wire.site_id();
  value.generation = wire.generation();
  value.site = std::move(wire.site());
  value.resolution_m = wire.resolution_m();
  value.epoch = wire.epoch();
  value.version = wire.version();
  value.levels = wire.levels();
  value.tile_count = wire.tile_count();
  value.x_min_m = wire.x_min_m();
  value.y_min_m = wire.y_min_m();
  value.x_max_m = wire.x_max_m();
  value.y_max_m = wire.y_max_m();
  value.robots = wire.robots();
  value.enabled_version = wire.enabled_version();
  value.versions.reserve(wire.versions().size());
  for (v1::MapVersion& version : wire.versions()) {
    value.versions.push_back({version.version(), version.enabled(), version.job(), std::move(version.note())});
  }
  value.edits_version = wire.edits_version();
  value.memory_bytes = wire.memory_bytes();
  value.memory_note = std::move(wire.memory_note());
  return value;
}

v1::MapEdit ToWire(const MapEdit& value) {
  v1::MapEdit wire;
  wire.id(value.id);
  wire.kind(static_cast<v1::MapEditKind>(value.kind));
  for (const Eigen::Vector2d& point : value.points_map) {
    v1::MapPoint& out = wire.points().emplace_back();
    out.x_m(point.x());
    out.y_m(point.y());
  }
  wire.width_m(value.width_m);
  wire.note(value.note);
  wire.made_ns(value.made);
  return wire;
}

MapEdit FromWire(v1::MapEdit&& wire) {
  MapEdit value;
  value.id = wire.id();
  value.kind = static_cast<MapEditKind>(wire.kind());
  for (const v1::MapPoint& point : wire.points()) value.points_map.emplace_back(point.x_m(), point.y_m());
  value.width_m = wire.width_m();
  value.note = std::move(wire.note());
  value.made = wire.made_ns();
  return value;
}

v1::TileContent ContentToWire(const Tile& value) {
  v1::TileContent wire;
  wire.epoch(value.epoch);
  wire.version(value.version);
  wire.encoding(static_cast<v1::TileEncoding>(value.encoding));
  wire.bytes(value.bytes);
  return wire;
}

void ContentFromWire(v1::TileContent&& wire, Tile& value) {
  value.epoch = wire.epoch();
  value.version = wire.version();
  value.encoding = static_cast<TileEncoding>(wire.encoding());
  value.bytes = std::move(wire.bytes());
}

bool FitsTileKey(const TileKey& key) {
  const auto fits = [](int v) {
    return v >= std::numeric_limits<std::int16_t>::min() && v <= std::numeric_limits<std::int16_t>::max();
  };
  return fits(key.x) && fits(key.y) && key.level >= 0 && key.level <= std::numeric_limits<std::uint8_t>::max();
}

v1::Tile ToWire(const TileSample& value) {
  v1::Tile wire;
  wire.site_id(value.site_id);
  wire.x(static_cast<std::int16_t>(value.tile.key.x));
  wire.y(static_cast<std::int16_t>(value.tile.key.y));
  wire.level(static_cast<std::uint8_t>(value.tile.key.level));
  wire.deleted(value.deleted);
  wire.generation(value.generation);
  wire.content(ContentToWire(value.tile));
  return wire;
}

TileSample FromWire(v1::Tile&& wire) {
  TileSample value;
  value.site_id = wire.site_id();
  value.tile.key = {wire.level(), wire.x(), wire.y()};
  value.deleted = wire.deleted();
  value.generation = wire.generation();
  ContentFromWire(std::move(wire.content()), value.tile);
  return value;
}

}  // namespace cairn::wire
