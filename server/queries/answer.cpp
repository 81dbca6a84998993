#include "server/queries/answer.h"

#include <utility>

#include "server/queries/jobs.h"
#include "server/queries/landmarks.h"
#include "server/queries/map_info.h"
#include "server/queries/path.h"
#include "server/queries/pose.h"
#include "server/queries/status.h"
#include "server/queries/tiles.h"

namespace cairn::server {
namespace {

Reply NoRobot(const Request& request) {
  return ReplyTo(request, {StatusCode::kNotFound, "robot '" + request.robot + "' has no session"});
}

Reply NoSite(const Request& request) {
  return ReplyTo(request, {StatusCode::kNotFound, "no site '" + request.site + "'"});
}

Reply OfRobot(const Request& request, const Views& views) {
  const auto session = views.session(request.robot);
  if (!session) return NoRobot(request);
  if (request.kind == RequestKind::kPose) return AnswerPose(request, *session);
  return AnswerPath(request, *session, views.map(session->status.session.site).get());
}

Reply OfSite(const Request& request, const Views& views) {
  const auto map = views.map(request.site);
  if (map == nullptr) return NoSite(request);
  if (request.kind == RequestKind::kTiles) return AnswerTiles(request, *map);
  return AnswerLandmarks(request, views.sessions());
}

Reply OfMaps(const Request& request, const Views& views) {
  if (request.site.empty()) return AnswerMapInfo(request, views.maps());
  const auto map = views.map(request.site);
  return map == nullptr ? NoSite(request) : AnswerMapInfo(request, {map});
}

Reply OfStatus(const Request& request, const Views& views) {
  if (request.robot.empty()) return AnswerStatus(request, views.sessions());
  const auto session = views.session(request.robot);
  return session ? AnswerStatus(request, {*session}) : NoRobot(request);
}

}  // namespace

Reply ReplyTo(const Request& request, Status status) {
  Reply reply;
  reply.client = request.client;
  reply.sequence = request.sequence;
  reply.status = std::move(status);
  return reply;
}

Reply Answer(const Request& request, const Views& views) {
  switch (request.kind) {
    case RequestKind::kPing:
      return ReplyTo(request);
    case RequestKind::kPose:
    case RequestKind::kPath:
      return OfRobot(request, views);
    case RequestKind::kTiles:
    case RequestKind::kLandmarks:
      return OfSite(request, views);
    case RequestKind::kMapInfo:
      return OfMaps(request, views);
    case RequestKind::kStatus:
      return OfStatus(request, views);
    case RequestKind::kJobGet:
      return AnswerJob(request, views.job(request.job));
    case RequestKind::kJobList:
      return AnswerJobs(request, views.jobs(request.site));
    case RequestKind::kJobSubmit:
    case RequestKind::kJobCancel:
    case RequestKind::kSessionEnd:
    case RequestKind::kMapEnable:
      break;
  }
  return ReplyTo(
      request, {StatusCode::kUnimplemented, "'" + std::string(RequestKindName(request.kind)) + "' is not a question"});
}

}  // namespace cairn::server
