#include "server/queries/path.h"

#include "server/queries/answer.h"

namespace cairn::server {

Reply AnswerPath(const Request& request, const SessionSnapshot& session, const MapSnapshot* map) {
  Reply reply = ReplyTo(request);
  if (map != nullptr) {
    reply.map_epoch = map->info.epoch;
    reply.map_version = map->info.version;
  }
  if (!request.smoothed) {
    reply.path = session.path.ToTrajectory();
    return reply;
  }
  const std::string& robot = session.status.session.robot;
  const auto none = [&] {
    return ReplyTo(request, {StatusCode::kFailedPrecondition,
                             "no smoothed path of '" + robot + "': no smoothing job of its site has finished"});
  };
  if (map == nullptr) return none();
  const auto smoothed = map->smoothed.find(robot);
  if (smoothed == map->smoothed.end()) return none();
  reply.path = *smoothed->second;
  return reply;
}

}  // namespace cairn::server
