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

// Upper estimates of an item's bytes on the wire.
std::size_t BytesOf(const PoseReport&) {
  return 384;
}
std::size_t BytesOf(const StampedPose&) {
  return 32;
}
std::size_t BytesOf(const Tile& tile) {
  return tile.bytes.size() + 64;
}
std::size_t BytesOf(const LandmarkReport&) {
  return 192;
}
std::size_t BytesOf(const MapInfo& info) {
  std::size_t bytes = 256;
  for (const MapVersionInfo& version : info.versions) bytes += version.note.size() + 48;
  return bytes;
}
std::size_t BytesOf(const RobotStatus& robot) {
  return 1024 + robot.session.status.message.size() + robot.ledgers.size() * 512;
}
std::size_t BytesOf(const SavedSite&) {
  return 192;
}
std::size_t BytesOf(const Job& job) {
  return job.message.size() + job.site.size() + 160;
}

class Parts {
 public:
  explicit Parts(Reply header) : header_(std::move(header)), current_(header_) {}

  template <typename Item>
  void AddAll(std::vector<Item>&& items, std::vector<Item> Reply::*list) {
    for (Item& item : items) {
      const std::size_t bytes = BytesOf(item);
      if (used_ > 0 && used_ + bytes > kPartBudgetBytes) Next();
      used_ += bytes;
      (current_.*list).push_back(std::move(item));
    }
  }

  std::vector<Reply> Finish() {
    Next();
    parts_.back().last = true;
    return std::move(parts_);
  }

 private:
  void Next() {
    current_.part = static_cast<std::uint32_t>(parts_.size());
    current_.last = false;
    parts_.push_back(std::move(current_));
    current_ = header_;
    used_ = 0;
  }

  const Reply header_;
  Reply current_;
  std::size_t used_ = 0;
  std::vector<Reply> parts_;
};

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

std::vector<Reply> SplitReply(Reply&& reply) {
  auto poses = std::exchange(reply.poses, {});
  auto path = std::exchange(reply.path, {});
  auto tiles = std::exchange(reply.tiles, {});
  auto landmarks = std::exchange(reply.landmarks, {});
  auto maps = std::exchange(reply.maps, {});
  auto robots = std::exchange(reply.robots, {});
  auto jobs = std::exchange(reply.jobs, {});
  auto saved = std::exchange(reply.saved, {});
  Parts parts(std::move(reply));
  parts.AddAll(std::move(poses), &Reply::poses);
  parts.AddAll(std::move(path), &Reply::path);
  parts.AddAll(std::move(tiles), &Reply::tiles);
  parts.AddAll(std::move(landmarks), &Reply::landmarks);
  parts.AddAll(std::move(maps), &Reply::maps);
  parts.AddAll(std::move(robots), &Reply::robots);
  parts.AddAll(std::move(jobs), &Reply::jobs);
  parts.AddAll(std::move(saved), &Reply::saved);
  return parts.Finish();
}

}  // namespace cairn::server
