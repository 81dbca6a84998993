// What a client can ask and order, one method each (query_client.h).
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "client/lib/query_client.h"

namespace cairn::client {
namespace {

// The answer's only element, which a server that says OK must give.
template <typename T>
Result<T> Only(std::vector<T>&& list, const char* what) {
  if (list.size() != 1) {
    return Fail(StatusCode::kInternal, fmt::format("the server answered with {} {} instead of one", list.size(), what));
  }
  return std::move(list.front());
}

Request MakeRequest(RequestKind kind) {
  Request request;
  request.kind = kind;
  return request;
}

Request AboutSite(RequestKind kind, const std::string& site) {
  Request request = MakeRequest(kind);
  request.site = site;
  return request;
}

Request AboutRobot(RequestKind kind, const std::string& robot) {
  Request request = MakeRequest(kind);
  request.robot = robot;
  return request;
}

Request AboutJob(RequestKind kind, std::uint64_t id) {
  Request request = MakeRequest(kind);
  request.job = id;
  return request;
}

}  // namespace

Result<std::string> QueryClient::Ping() {
  return Ask(MakeRequest(RequestKind::kPing)).map([](Reply&& reply) { return std::move(reply.server_version); });
}

Result<PoseReport> QueryClient::Pose(const std::string& robot, std::optional<Stamp> at) {
  Request request = AboutRobot(RequestKind::kPose, robot);
  request.latest = !at.has_value();
  request.stamp = at.value_or(0);
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.poses), "poses"); });
}

Result<std::vector<PoseHypothesis>> QueryClient::Hypotheses(const std::string& robot) {
  return Ask(AboutRobot(RequestKind::kPose, robot)).map([](Reply&& reply) { return std::move(reply.hypotheses); });
}

Result<PathAnswer> QueryClient::Path(const std::string& robot, bool smoothed) {
  Request request = AboutRobot(RequestKind::kPath, robot);
  request.smoothed = smoothed;
  return Ask(request).map([](Reply&& reply) { return PathAnswer{std::move(reply.path), reply.map_epoch}; });
}

Result<StatusAnswer> QueryClient::ServerStatus(const std::string& robot) {
  return Ask(AboutRobot(RequestKind::kStatus, robot)).map([](Reply&& reply) {
    return StatusAnswer{std::move(reply.robots), std::move(reply.status.message),
                        reply.refused.empty() ? Refusals{} : reply.refused.front(),
                        reply.load.empty() ? ServerLoad{} : reply.load.front()};
  });
}

Result<std::vector<RobotStatus>> QueryClient::Robots(const std::string& robot) {
  return ServerStatus(robot).map([](StatusAnswer&& answer) { return std::move(answer.robots); });
}

Result<Ros2Report> QueryClient::Ros2() {
  return Ask(MakeRequest(RequestKind::kRos2)).map([](Reply&& reply) {
    return Ros2Report{reply.ros2.empty() ? Ros2DoorState{} : std::move(reply.ros2.front()),
                      std::move(reply.ros2_namespaces)};
  });
}

Result<void> QueryClient::EndSession(const std::string& robot) {
  return Ask(AboutRobot(RequestKind::kSessionEnd, robot)).map([](Reply&&) {});
}

Result<std::optional<Job>> QueryClient::Relocalise(const std::string& robot, const std::optional<Pose2>& T_map_robot) {
  Request request = AboutRobot(RequestKind::kRelocalise, robot);
  request.T_map_robot = T_map_robot;
  return Ask(request).map([](Reply&& reply) {
    return reply.jobs.empty() ? std::optional<Job>() : std::optional<Job>(std::move(reply.jobs.front()));
  });
}

Result<void> QueryClient::Localise(const std::string& robot) {
  return Ask(AboutRobot(RequestKind::kLocalise, robot)).map([](Reply&&) {});
}

Result<void> QueryClient::MapAgain(const std::string& robot) {
  return Ask(AboutRobot(RequestKind::kMap, robot)).map([](Reply&&) {});
}

Result<std::vector<MapInfo>> QueryClient::Maps() {
  return Ask(MakeRequest(RequestKind::kMapInfo)).map([](Reply&& reply) { return std::move(reply.maps); });
}

Result<MapInfo> QueryClient::Map(const std::string& site) {
  return Ask(AboutSite(RequestKind::kMapInfo, site)).and_then([](Reply&& reply) {
    return Only(std::move(reply.maps), "maps");
  });
}

Result<TileAnswer> QueryClient::Tiles(const TileQuery& query) {
  Request request = AboutSite(RequestKind::kTiles, query.site);
  request.area = query.area;
  request.level = query.level;
  request.since_generation = query.since_generation;
  request.since_epoch = query.since_epoch;
  request.since_version = query.since_version;
  request.disagreement = query.disagreement;
  return Ask(request).map([](Reply&& reply) {
    return TileAnswer{reply.generation, reply.map_epoch, reply.map_version, std::move(reply.tiles)};
  });
}

Result<std::vector<Tile>> QueryClient::RobotTiles(const std::string& robot, std::uint32_t level) {
  Request request = AboutRobot(RequestKind::kTiles, robot);
  request.level = level;
  return Ask(request).map([](Reply&& reply) { return std::move(reply.tiles); });
}

Result<OccupancyImage> QueryClient::ImageOf(const TileQuery& query, const std::string& none) {
  auto info = Map(query.site);
  if (!info) return tl::unexpected(info.error());
  auto answer = Tiles(query);
  if (!answer) return tl::unexpected(answer.error());
  if (answer->tiles.empty()) return Fail(StatusCode::kUnavailable, none);
  for (Tile& tile : answer->tiles) tile.key.level = 0;  // Of a map with larger cells.
  return AssembleTiles(answer->tiles, info->resolution_m * static_cast<double>(1U << query.level));
}

Result<OccupancyImage> QueryClient::MapImage(const std::string& site, std::uint32_t level) {
  TileQuery query;
  query.site = site;
  query.level = level;
  return ImageOf(query, fmt::format("site '{}' has no tile yet", site));
}

Result<OccupancyImage> QueryClient::DisagreementImage(const std::string& site, std::uint32_t level) {
  TileQuery query;
  query.site = site;
  query.level = level;
  query.disagreement = true;
  return ImageOf(query, fmt::format("nobody disagrees about the map of site '{}'", site));
}

Result<std::vector<LandmarkReport>> QueryClient::Landmarks(const std::string& site, const Area& area) {
  Request request = AboutSite(RequestKind::kLandmarks, site);
  request.area = area;
  return Ask(request).map([](Reply&& reply) { return std::move(reply.landmarks); });
}

Result<std::vector<MapEdit>> QueryClient::MapEdits(const std::string& site) {
  return Ask(AboutSite(RequestKind::kMapEdits, site)).and_then([](Reply&& reply) -> Result<std::vector<MapEdit>> {
    // CellsOf needs it, and whatever answers here may be another program.
    for (const MapEdit& edit : reply.edits) {
      if (auto valid = ValidateMapEdit(edit); !valid)
        return Fail(StatusCode::kInternal, "the server's answer cannot be: " + valid.error().message);
    }
    return std::move(reply.edits);
  });
}

Result<MapEdit> QueryClient::AddMapEdit(const std::string& site, const MapEdit& edit) {
  Request request = AboutSite(RequestKind::kMapEditAdd, site);
  request.edit = edit;
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.edits), "edits"); });
}

Result<void> QueryClient::RemoveMapEdit(const std::string& site, std::uint64_t id) {
  Request request = AboutSite(RequestKind::kMapEditRemove, site);
  request.edit.id = id;
  return Ask(request).map([](Reply&&) {});
}

Result<MapInfo> QueryClient::EnableMap(const std::string& site, std::uint32_t map_version) {
  Request request = AboutSite(RequestKind::kMapEnable, site);
  request.map_version = map_version;
  return Ask(request).and_then([&](Reply&&) { return Map(site); });
}

Result<MapInfo> QueryClient::RollBackMap(const std::string& site) {
  auto info = Map(site);
  if (!info) return info;
  std::uint32_t before = 0;
  for (const MapVersionInfo& version : info->versions) {
    if (version.version < info->enabled_version) before = std::max(before, version.version);
  }
  if (before == 0) {
    return Fail(StatusCode::kFailedPrecondition,
                fmt::format("site '{}' has no version before {}", site, info->enabled_version));
  }
  return EnableMap(site, before);
}

Result<std::vector<SavedSite>> QueryClient::SavedSites() {
  return Ask(MakeRequest(RequestKind::kSavedList)).map([](Reply&& reply) { return std::move(reply.saved); });
}

Result<SavedSite> QueryClient::SaveSite(const std::string& site, const std::string& name) {
  Request request = AboutSite(RequestKind::kSiteSave, site);
  request.saved = name;
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.saved), "saved sites"); });
}

Result<void> QueryClient::LoadSite(const std::string& name, const std::string& site) {
  Request request = AboutSite(RequestKind::kSiteLoad, site);
  request.saved = name;
  return Ask(request).map([](Reply&&) {});
}

Result<void> QueryClient::DeleteSite(const std::string& site) {
  return Ask(AboutSite(RequestKind::kSiteDelete, site)).map([](Reply&&) {});
}

Result<void> QueryClient::DeleteSavedSite(const std::string& name) {
  Request request = MakeRequest(RequestKind::kSiteDelete);
  request.saved = name;
  return Ask(request).map([](Reply&&) {});
}

Result<Job> QueryClient::AskForJob(const Request& request) {
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.jobs), "jobs"); });
}

Result<Job> QueryClient::SubmitJob(const std::string& site, JobKind kind, bool enable) {
  Request request = AboutSite(RequestKind::kJobSubmit, site);
  request.job_kind = kind;
  request.enable = enable;
  return AskForJob(request);
}

Result<Job> QueryClient::GetJob(std::uint64_t id) {
  return AskForJob(AboutJob(RequestKind::kJobGet, id));
}

Result<Job> QueryClient::CancelJob(std::uint64_t id) {
  return AskForJob(AboutJob(RequestKind::kJobCancel, id));
}

Result<std::vector<Job>> QueryClient::Jobs(const std::string& site) {
  return Ask(AboutSite(RequestKind::kJobList, site)).map([](Reply&& reply) { return std::move(reply.jobs); });
}

Result<Job> QueryClient::WaitForJob(std::uint64_t id, const std::function<bool(const Job&)>& keep_waiting) {
  constexpr std::chrono::milliseconds kPause{100};
  std::optional<Stamp> submitted;
  for (;;) {
    Result<Job> job = GetJob(id);
    if (job && submitted && job->submitted != *submitted)
      return Fail(StatusCode::kAborted,
                  fmt::format("the server has started again without its state, and job {} is another one now", id));
    if (job) submitted = job->submitted;
    if (!job || IsFinal(job->state) || (keep_waiting && !keep_waiting(*job))) return job;
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace cairn::client
