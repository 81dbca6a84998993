#include "server/queries/answers.h"

#include <cmath>
#include <string>
#include <utility>

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
    if (request.latest) reply.hypotheses = session.hypotheses;
    // None are known since the server was started, or since the map has moved.
    if (request.latest && newest.localized && reply.hypotheses.empty())
      reply.hypotheses = {{newest.stamp, newest.T_map_robot, 1.0}};
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

Answer AnswerPath(const Request& request, const Sessions& sessions, const Maps& maps) {
  if (sessions.empty()) return NoRobot(request);
  const SessionSnapshot& session = sessions.front();
  const MapSnapshot* const map = maps.empty() ? nullptr : maps.front().get();
  Reply reply = ReplyTo(request);
  if (map != nullptr) {
    reply.map_epoch = map->info.epoch;
    reply.map_version = map->info.version;
  }
  if (!request.smoothed) return {std::move(reply), PathItems(session.path)};
  const std::string& robot = session.status.session.robot;
  const auto refuse = [&](const std::string& why) {
    return ReplyTo(request, {StatusCode::kFailedPrecondition, "no smoothed path of '" + robot + "': " + why});
  };
  const SmoothedPaths none;
  const SmoothedPaths& paths = map == nullptr ? none : map->smoothed;
  const auto smoothed = paths.find(robot);
  if (smoothed == paths.end()) return refuse("no smoothing job of its site has finished");
  if (smoothed->second.session != 0 && smoothed->second.session != session.id)
    return refuse("its session began after the last smoothing job");
  return {std::move(reply), PathItems(smoothed->second.path)};
}

Reply AnswerStatus(const Request& request, const Sessions& sessions) {
  if (!request.robot.empty() && sessions.empty()) return NoRobot(request);
  Reply reply = ReplyTo(request);
  for (const SessionSnapshot& session : sessions) {
    if (request.site.empty() || session.status.session.site == request.site) reply.robots.push_back(session.status);
  }
  return reply;
}

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

std::optional<Reply> RefusesTiles(const Request& request, const Maps& maps) {
  if (maps.empty()) return NoSite(request);
  const MapSnapshot& map = *maps.front();
  if (request.level >= map.info.levels) {
    return ReplyTo(request, {StatusCode::kInvalidArgument, "level " + std::to_string(request.level) +
                                                               " does not exist; levels are 0.." +
                                                               std::to_string(map.info.levels - 1)});
  }
  if (!IsValid(request.area)) return BadArea(request);
  return std::nullopt;
}

Answer AnswerTiles(const Request& request, const Maps& maps, Generation generation) {
  if (auto refused = RefusesTiles(request, maps)) return *std::move(refused);
  const MapSnapshot& map = *maps.front();
  Reply reply = ReplyTo(request);
  reply.map_epoch = map.info.epoch;
  reply.map_version = map.info.version;
  const int level = static_cast<int>(request.level);
  // Versions are those of the map. The layer of disagreement may change without it.
  const bool all =
      request.disagreement || request.since_generation != generation || request.since_epoch != map.info.epoch;
  std::vector<std::shared_ptr<const Tile>> tiles;
  const TileSet& layer = request.disagreement ? map.disagreement : map.tiles;
  layer.ForEach(level, [&](const std::shared_ptr<const Tile>& tile) {
    if (!all && tile->version <= request.since_version) return;
    if (Overlap(request.area, AreaOf(tile->key, map.info.resolution_m))) tiles.push_back(tile);
  });
  return {std::move(reply), std::move(tiles)};
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

Reply AnswerMapEdits(const Request& request, const Maps& maps) {
  if (maps.empty()) return NoSite(request);
  Reply reply = ReplyTo(request);
  reply.edits = *maps.front()->edits;
  return reply;
}

}  // namespace cairn::server
