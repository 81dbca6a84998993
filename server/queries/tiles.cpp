#include "server/queries/tiles.h"

#include <string>

#include "server/queries/answer.h"
#include "server/queries/area.h"

namespace cairn::server {
namespace {

Area AreaOf(const TileKey& key, double resolution_m) {
  const double side_m = kTileCells * resolution_m * static_cast<double>(1 << key.level);
  return {key.x * side_m, key.y * side_m, (key.x + 1) * side_m, (key.y + 1) * side_m};
}

}  // namespace

Reply AnswerTiles(const Request& request, const MapSnapshot& map) {
  if (request.level >= map.info.levels) {
    return ReplyTo(request, {StatusCode::kInvalidArgument, "level " + std::to_string(request.level) +
                                                               " does not exist; levels are 0.." +
                                                               std::to_string(map.info.levels - 1)});
  }
  if (!IsValid(request.area)) {
    return ReplyTo(request,
                   {StatusCode::kInvalidArgument, "the area is not finite or its minimum exceeds its maximum"});
  }
  Reply reply = ReplyTo(request);
  reply.map_epoch = map.info.epoch;
  reply.map_version = map.info.version;
  const int level = static_cast<int>(request.level);
  const bool all = request.since_epoch != map.info.epoch;
  const bool everywhere = IsEverywhere(request.area);
  constexpr int kLowest = INT32_MIN;
  for (auto it = map.tiles.lower_bound({level, kLowest, kLowest}); it != map.tiles.end(); ++it) {
    const auto& [key, tile] = *it;
    if (key.level != level) break;
    if (!all && tile->version <= request.since_version) continue;
    if (everywhere || Overlap(request.area, AreaOf(key, map.info.resolution_m))) reply.tiles.push_back(*tile);
  }
  return reply;
}

}  // namespace cairn::server
