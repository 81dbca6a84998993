// What the commands of ROS 2 programs do: each is one or several requests to the desk, as a native client would send
// them. All of it runs on the thread of the bus.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "common/service/names.h"
#include "server/ros2/ros2_service_templates.h"
#include "server/ros2/ros2_services.h"

namespace cairn::server {
namespace {

// A session that was ended may take a moment to leave its site.
constexpr int kDeleteTries = 30;
constexpr std::chrono::seconds kMapOfLoadedWaits{5};

Request About(RequestKind kind, const std::string& site) {
  Request request;
  request.kind = kind;
  request.site = site;
  return request;
}

std::vector<std::string> RobotsOf(const std::vector<SessionState>& sessions) {
  std::vector<std::string> robots;
  robots.reserve(sessions.size());
  for (const SessionState& session : sessions) robots.push_back(session.robot);
  return robots;
}

}  // namespace

std::uint8_t LoadMapResult(const Status& status) {
  switch (status.code) {
    case StatusCode::kOk:
      return ros2::LoadMap::kSuccess;
    case StatusCode::kNotFound:
    case StatusCode::kInvalidArgument:  // No saved site can have such a name.
      return ros2::LoadMap::kMapDoesNotExist;
    case StatusCode::kDataLoss:
      return ros2::LoadMap::kInvalidMapData;
    case StatusCode::kFailedPrecondition:  // Cells of another size, or a newer format.
      return ros2::LoadMap::kInvalidMapMetadata;
    default:
      return ros2::LoadMap::kUndefinedFailure;
  }
}

std::uint8_t SaveMapResult(const Status& status) {
  if (status.ok()) return ros2::SaveMap::kSuccess;
  return status.code == StatusCode::kNotFound ? ros2::SaveMap::kNoMapReceived : ros2::SaveMap::kUndefinedFailure;
}

void Ros2Services::Load(ros2::LoadMap::Request&& request, const Asked<ros2::LoadMap>& asked) {
  // A URL of ROS would be a path or a package; this is the name of a saved site, and nothing else is looked for.
  if (const auto valid = ValidateName("map_url", request.map_url); !valid)
    return Answer(asked, {{}, LoadMapResult(valid.error())});
  Request load = About(RequestKind::kSiteLoad, {});
  load.saved = std::move(request.map_url);
  commands_.Ask(
      asked.asker(), std::move(load),
      [this, asked](const Reply& reply) {
        if (!reply.status.ok()) return Answer(asked, {{}, LoadMapResult(reply.status)});
        const std::string site = reply.saved.empty() ? std::string() : reply.saved.front().site;
        MapWish wish{asked.asker(), HashName(site), true, now_ + kMapOfLoadedWaits,
                     [this, asked](const ros2::Grid& map) {
                       return Send(asked, {map, ros2::LoadMap::kSuccess});
                     }};
        if (!doors_.want_map(std::move(wish))) Answer(asked, {{}, ros2::LoadMap::kSuccess});
      },
      now_);
}

void Ros2Services::Save(NameId site_id, const std::string& name, std::uint64_t asker,
                        std::function<void(const Status&)> done) {
  if (!name.empty()) {
    if (const auto valid = ValidateName("name", name); !valid) return done(valid.error());
  }
  Request save = About(RequestKind::kSiteSave, sites_.at(site_id).name);
  save.saved = name;
  commands_.Ask(
      asker, std::move(save), [done = std::move(done)](const Reply& reply) { done(reply.status); }, now_);
}

void Ros2Services::WithSessions(const std::string& site, std::uint64_t asker, std::function<void(Sessions)> then) {
  commands_.Ask(
      asker, About(RequestKind::kStatus, site),
      [then = std::move(then)](const Reply& reply) {
        if (!reply.status.ok()) return then(std::nullopt);
        std::vector<SessionState> sessions;
        for (const RobotStatus& robot : reply.robots) {
          const SessionPhase phase = robot.session.phase;
          if (phase == SessionPhase::kActive || phase == SessionPhase::kSuspended) sessions.push_back(robot.session);
        }
        then(std::move(sessions));
      },
      now_);
}

void Ros2Services::ForEach(const std::shared_ptr<Round>& round, std::function<void(bool all)> then) {
  if (round->next >= round->robots.size()) return then(round->all);
  Request request;
  request.kind = round->kind;
  request.robot = round->robots[round->next++];
  commands_.Ask(
      round->asker, std::move(request),
      [this, round, then = std::move(then)](const Reply& reply) {
        if (!reply.status.ok()) {
          round->all = false;
          spdlog::warn("ROS 2: {} of robot {} failed: {}", RequestKindName(round->kind), round->robots[round->next - 1],
                       reply.status.message);
        }
        // The others would be refused as well, and within this call.
        if (reply.status.code == StatusCode::kResourceExhausted) return then(false);
        ForEach(round, then);
      },
      now_);
}

void Ros2Services::TogglePause(NameId site_id, const Asked<ros2::Pause>& asked) {
  const std::string site = sites_.at(site_id).name;
  WithSessions(site, asked.asker(), [this, site, asked](Sessions sessions) {
    if (!sessions || sessions->empty()) return Answer(asked, {false});
    const auto is_paused = [](const SessionState& session) { return session.localise_only; };
    const bool pause = !std::all_of(sessions->begin(), sessions->end(), is_paused);
    if (pause) std::erase_if(*sessions, is_paused);
    const auto round = std::make_shared<Round>();
    *round = {asked.asker(), pause ? RequestKind::kLocalise : RequestKind::kMap, RobotsOf(*sessions)};
    ForEach(round, [this, site, pause, asked](bool all) {
      spdlog::info("ROS 2: the robots of site {} {}{}", site, pause ? "are only localised" : "map again",
                   all ? "" : ", except for some");
      Answer(asked, {all});
    });
  });
}

void Ros2Services::Reset(NameId site_id, const ros2::Reset::Request& request, const Asked<ros2::Reset>& asked) {
  // In a site without a map, robots cannot only be localised.
  if (request.pause_new_measurements) return Answer(asked, {ros2::Reset::kFailure});
  const std::string site = sites_.at(site_id).name;
  // A job would forbid the deletion, and then no session is to be ended either.
  commands_.Ask(
      asked.asker(), About(RequestKind::kJobList, site),
      [this, site, asked](const Reply& reply) {
        const bool idle =
            std::all_of(reply.jobs.begin(), reply.jobs.end(), [](const Job& job) { return IsFinal(job.state); });
        if (!reply.status.ok() || !idle) {
          spdlog::warn("ROS 2: site {} is not reset: {}", site, idle ? reply.status.message : "a job of it runs");
          return Answer(asked, {ros2::Reset::kFailure});
        }
        EndAndDelete(site, asked);
      },
      now_);
}

void Ros2Services::EndAndDelete(const std::string& site, const Asked<ros2::Reset>& asked) {
  WithSessions(site, asked.asker(), [this, site, asked](Sessions sessions) {
    if (!sessions) return Answer(asked, {ros2::Reset::kFailure});
    const auto round = std::make_shared<Round>();
    *round = {asked.asker(), RequestKind::kSessionEnd, RobotsOf(*sessions)};
    // One that could not be ended has ended by itself, or forbids the deletion.
    ForEach(round, [this, site, asked](bool /*all*/) { Delete(site, kDeleteTries, asked); });
  });
}

void Ros2Services::Delete(const std::string& site, int tries, const Asked<ros2::Reset>& asked) {
  commands_.Ask(
      asked.asker(), About(RequestKind::kSiteDelete, site),
      [this, site, tries, asked](const Reply& reply) {
        if (reply.status.code == StatusCode::kFailedPrecondition && tries > 1) return Delete(site, tries - 1, asked);
        spdlog::info("ROS 2: site {} {}", site,
                     reply.status.ok() ? "is reset" : "is not reset: " + reply.status.message);
        doors_.begin_anew(site);  // Also where it failed: sessions have ended.
        Answer(asked, {reply.status.ok() ? ros2::Reset::kSuccess : ros2::Reset::kFailure});
        lingering_.push_back({now_ + kAnswerWaits, asked.answers});
      },
      now_);
}

}  // namespace cairn::server
