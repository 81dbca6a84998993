#include <cmath>
#include <string>

#include "server/queries/answers.h"

namespace cairn::server {
namespace {

Reply NoSite(const Request& request) {
  return ReplyTo(request, {StatusCode::kNotFound, "no site '" + request.site + "'"});
}

Reply BadArea(const Request& request) {
  return ReplyTo(request, {StatusCode::kInvalidArgument, "the area is not finite or its minimum exceeds its maximum"});
}

bool IsEverywhere(const Area& area) {
  return area.x_min_m == 0 && area.y_min_m == 0 && area.x_max_m == 0 && area.y_max_m == 0;
}

bool IsValid(const Area& area) {
  const bool finite = std::isfinite(area.x_min_m) && std::isfinite(area.y_min_m) && std::isfinite(area.x_max_m) &&
                      std::isfinite(area.y_max_m);
  return finite && area.x_min_m <= area.x_max_m && area.y_min_m <= area.y_max_m;
}

// Areas that only touch overlap too. An area that means "everywhere" overlaps every other.
bool Overlap(const Area& wanted, const Area& other) {
  return IsEverywhere(wanted) || (wanted.x_min_m <= other.x_max_m && other.x_min_m <= wanted.x_max_m &&
                                  wanted.y_min_m <= other.y_max_m && other.y_min_m <= wanted.y_max_m);
}

Area AreaOf(const TileKey& key, double resolution_m) {
  const double side_m = kTileCells * resolution_m * static_cast<double>(1 << key.level);
  return {key.x * side_m, key.y * side_m, (key.x + 1) * side_m, (key.y + 1) * side_m};
}

}  // namespace

Reply AnswerLandmarks(const Request& request, const Sessions& sessions, const Maps& maps) {
  if (maps.empty()) return NoSite(request);
  if (!IsValid(request.area)) return BadArea(request);
  Reply reply = ReplyTo(request);
  for (const SessionSnapshot& session : sessions) {
    if (session.status.session.site != request.site) continue;
    for (const LandmarkReport& landmark : *session.landmarks) {
      const Area point{landmark.p_map.x(), landmark.p_map.y(), landmark.p_map.x(), landmark.p_map.y()};
      if (Overlap(request.area, point)) reply.landmarks.push_back(landmark);
    }
  }
  return reply;
}

Reply AnswerTiles(const Request& request, const Maps& maps, Generation generation) {
  if (maps.empty()) return NoSite(request);
  const MapSnapshot& map = *maps.front();
  if (request.level >= map.info.levels) {
    return ReplyTo(request, {StatusCode::kInvalidArgument, "level " + std::to_string(request.level) +
                                                               " does not exist; levels are 0.." +
                                                               std::to_string(map.info.levels - 1)});
  }
  if (!IsValid(request.area)) return BadArea(request);
  Reply reply = ReplyTo(request);
  reply.map_epoch = map.info.epoch;
  reply.map_version = map.info.version;
  const int level = static_cast<int>(request.level);
  const bool all = request.since_generation != generation || request.since_epoch != map.info.epoch;
  constexpr int kLowest = INT32_MIN;
  for (auto it = map.tiles.lower_bound({level, kLowest, kLowest}); it != map.tiles.end(); ++it) {
    const auto& [key, tile] = *it;
    if (key.level != level) break;
    if (!all && tile->version <= request.since_version) continue;
    if (Overlap(request.area, AreaOf(key, map.info.resolution_m))) reply.tiles.push_back(*tile);
  }
  return reply;
}

Reply AnswerMapInfo(const Request& request, const Maps& maps) {
  if (!request.site.empty() && maps.empty()) return NoSite(request);
  Reply reply = ReplyTo(request);
  for (const auto& map : maps) reply.maps.push_back(map->info);
  if (maps.size() == 1) {
    reply.map_epoch = maps.front()->info.epoch;
    reply.map_version = maps.front()->info.version;
  }
  return reply;
}

}  // namespace cairn::server
