#include "server/queries/pose.h"

#include "server/queries/answer.h"

namespace cairn::server {
namespace {

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

Reply AnswerPose(const Request& request, const SessionSnapshot& session) {
  const PoseReport& newest = session.status.pose;
  const PathView& path = session.path;
  const std::string robot = "'" + session.status.session.robot + "'";
  if (path.empty()) {
    return ReplyTo(request, {StatusCode::kUnavailable, "not yet: no scan of " + robot + " has been used"});
  }
  Reply reply = ReplyTo(request);
  reply.map_epoch = newest.map_epoch;
  if (request.latest || request.stamp == newest.stamp) {
    reply.poses.push_back(newest);
    return reply;
  }
  if (request.stamp < path.first_stamp()) {
    return ReplyTo(request, {StatusCode::kOutOfRange, "never: the stamp lies before the first pose of " + robot});
  }
  if (request.stamp > path.last_stamp()) {
    const bool ended = session.status.session.phase == SessionPhase::kEnded;
    return ReplyTo(request, ended ? Status{StatusCode::kOutOfRange, "never: the session of " + robot + " ended before"}
                                  : Status{StatusCode::kUnavailable, "not yet: the stamp lies after the newest pose"});
  }
  reply.poses.push_back(ReportAt(newest, request.stamp, *path.At(request.stamp)));
  return reply;
}

}  // namespace cairn::server
