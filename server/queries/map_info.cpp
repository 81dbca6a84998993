#include "server/queries/map_info.h"

#include "server/queries/answer.h"

namespace cairn::server {

Reply AnswerMapInfo(const Request& request, const std::vector<std::shared_ptr<const MapSnapshot>>& maps) {
  Reply reply = ReplyTo(request);
  for (const auto& map : maps) reply.maps.push_back(map->info);
  if (maps.size() == 1) {
    reply.map_epoch = maps.front()->info.epoch;
    reply.map_version = maps.front()->info.version;
  }
  return reply;
}

}  // namespace cairn::server
