#include "client/cli/fetch_map.h"

namespace cairn::client {

Result<MapInfo> FetchMapInfo(Program& program, const std::string& site) {
  Request request;
  request.kind = RequestKind::kMapInfo;
  request.site = site;
  auto reply = program.Ask(request);
  if (!reply) return tl::unexpected(reply.error());
  if (reply->maps.empty()) return Fail(StatusCode::kNotFound, "site '" + site + "' has no map");
  return reply->maps.front();
}

Result<OccupancyImage> FetchMap(Program& program, const std::string& site) {
  const auto info = FetchMapInfo(program, site);
  if (!info) return tl::unexpected(info.error());
  Request request;
  request.kind = RequestKind::kTiles;
  request.site = site;
  const auto reply = program.Ask(request);
  if (!reply) return tl::unexpected(reply.error());
  if (reply->tiles.empty()) return Fail(StatusCode::kUnavailable, "site '" + site + "' has no tile yet");
  return AssembleTiles(reply->tiles, info->resolution_m);
}

}  // namespace cairn::client
