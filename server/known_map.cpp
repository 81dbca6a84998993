#include "server/known_map.h"

#include <memory>
#include <utility>

#include "common/map/map_lines.h"

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

}  // namespace cairn::server
