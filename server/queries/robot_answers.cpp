#include <string>
#include <utility>

#include "server/queries/answers.h"

namespace cairn::server {
namespace {

Reply NoRobot(const Request& request) {
  return ReplyTo(request, {StatusCode::kNotFound, "robot '" + request.robot + "' has no session"});
}

PoseReport ReportAt(const PoseReport& newest, Stamp stamp, const PathPose& pose) {
  PoseReport report = newest;
  report.stamp = stamp;
  report.scan_sequence = 0;
  report.T_map_robot = pose.T_map_robot;
  report.covariance = pose.covariance.cast<double>();
  report.T_map_odom = pose.T_map_odom;
  report.localized = pose.localized;
  report.score = pose.score;
  report.reason = pose.reason;
  return report;
}

}  // namespace

Reply ReplyTo(const Request& request, Status status) {
  Reply reply;
  reply.client = request.client;
  reply.sequence = request.sequence;
  reply.status = std::move(status);
  return reply;
}

Reply AnswerPose(const Request& request, const Sessions& sessions) {
  if (sessions.empty()) return NoRobot(request);
  const SessionSnapshot& session = sessions.front();
  const PoseReport& newest = session.status.pose;
  const PathView& path = session.path;
  const std::string robot = "'" + session.status.session.robot + "'";
  if (path.empty()) {
    return ReplyTo(request, {StatusCode::kUnavailable, "no pose yet: no scan of " + robot + " has been used"});
  }
  Reply reply = ReplyTo(request);
  reply.map_epoch = newest.map_epoch;
  if (request.latest || request.stamp == newest.stamp) {
    reply.poses.push_back(newest);
    return reply;
  }
  if (request.stamp < path.first_stamp()) {
    return ReplyTo(request, {StatusCode::kOutOfRange, "the stamp lies before the first pose of " + robot});
  }
  if (request.stamp > path.last_stamp()) {
    const bool ended = session.status.session.phase == SessionPhase::kEnded;
    return ReplyTo(
        request,
        ended ? Status{StatusCode::kOutOfRange, "the session of " + robot + " ended before the stamp"}
              : Status{StatusCode::kUnavailable, "no pose yet: the stamp lies after the newest pose of " + robot});
  }
  reply.poses.push_back(ReportAt(newest, request.stamp, *path.At(request.stamp)));
  return reply;
}

Reply AnswerPath(const Request& request, const Sessions& sessions, const Maps& maps) {
  if (sessions.empty()) return NoRobot(request);
  const SessionSnapshot& session = sessions.front();
  const MapSnapshot* const map = maps.empty() ? nullptr : maps.front().get();
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
  if (map == nullptr || !map->smoothed.contains(robot)) {
    return ReplyTo(request, {StatusCode::kFailedPrecondition,
                             "no smoothed path of '" + robot + "': no smoothing job of its site has finished"});
  }
  reply.path = *map->smoothed.at(robot);
  return reply;
}

Reply AnswerStatus(const Request& request, const Sessions& sessions) {
  if (!request.robot.empty() && sessions.empty()) return NoRobot(request);
  Reply reply = ReplyTo(request);
  for (const SessionSnapshot& session : sessions) {
    if (request.site.empty() || session.status.session.site == request.site) reply.robots.push_back(session.status);
  }
  return reply;
}

}  // namespace cairn::server
