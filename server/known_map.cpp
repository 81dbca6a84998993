#include "server/known_map.h"

#include <memory>
#include <utility>

#include "common/map/map_lines.h"
#include "common/map/map_tiles.h"

namespace cairn::server {

Result<void> LoadKnownMap(slam::MapperOptions& options) {
  if (options.filter.kind != slam::FilterKind::kLineMatch) return {};
  slam::LocalizationOptions& line_match = options.filter.line_match;
  if (line_match.file.empty())
    return Fail(StatusCode::kInvalidArgument,
                "slam.line_match.map is empty; slam.filter line_match needs the name of the map file there");
  auto map = ReadMapLines(line_match.file);
  if (!map) return Fail(map.error().code, "slam.line_match.map: " + map.error().message);
  line_match.map = std::make_shared<const std::vector<MapLine>>(*std::move(map));
  return {};
}

Result<std::shared_ptr<const slam::KnownGrid>> ReadKnownGrid(const std::filesystem::path& yaml,
                                                             const slam::MapperOptions& options) {
  const auto map = LoadMapYaml(yaml);
  if (!map) return tl::unexpected(map.error());
  const auto cells = ResampleToTiles(*map, options.grid.resolution_m);
  if (!cells) return Fail(cells.error().code, yaml.string() + ": " + cells.error().message);
  slam::KnownGrid::Source source;
  source.resolution_m = options.grid.resolution_m;
  for (const auto& [key, tile] : *cells)
    source.tiles.emplace(slam::ChunkKey{key.x, key.y}, std::make_shared<const TileCells>(tile));
  if (!slam::KnownGrid::IsBounded(source))
    return Fail(StatusCode::kOutOfRange, yaml.string() + ": the map is too large for a robot to be found in it");
  return std::make_shared<const slam::KnownGrid>(std::move(source), options.recovery.place, options.self_check.near_m);
}

}  // namespace cairn::server
