#include "server/setup/known_map.h"

#include <memory>
#include <utility>

#include "common/map/map_lines.h"

namespace cairn::server {

Result<void> LoadKnownMap(slam::MapperOptions& options) {
  if (options.filter.kind != slam::FilterKind::kLineMatch) return {};
  slam::LocalizationOptions& line_match = options.filter.line_match;
  if (line_match.file.empty())
    return Fail(StatusCode::kInvalidArgument, "slam.filter line_match needs slam.line_match.map: the file of the map");
  const slam::PlaceOptions& places = line_match.places;
  if (places.settled * (1.0 - places.memory) >= 1.0)
    return Fail(StatusCode::kInvalidArgument,
                "slam.line_match.places: settled must be below 1 / (1 - memory), the most evidence there can be");
  auto map = ReadMapLines(line_match.file);
  if (!map) return Fail(map.error().code, "slam.line_match.map: " + map.error().message);
  line_match.map = std::make_shared<const std::vector<MapLine>>(*std::move(map));
  return {};
}

}  // namespace cairn::server
