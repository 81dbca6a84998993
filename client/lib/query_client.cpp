#include "client/lib/query_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "client/lib/client_id.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kFirstPatience{2};   // For the first part of an answer; then the question is repeated.
constexpr std::chrono::seconds kAnswerPatience{1};  // Pings of a server that was found are not answered for so long.
constexpr std::chrono::seconds kHostileFirstPatience{1};  // Where forged messages may have made the client deaf.

constexpr std::chrono::milliseconds kPingPatience{100};  // For the answer to a ping; then a new one is begun.
constexpr std::chrono::milliseconds kPingEvery{20};      // Until then the same one is sent again.
constexpr std::chrono::steady_clock::duration kOnce{0};  // A question is not sent again.

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

QueryClient::QueryClient(wire::Bus& bus, const QueryClientOptions& options) : bus_(bus), options_(options) {}

QueryClient::~QueryClient() {
  const std::shared_ptr<Wire> last = CurrentWire();
  if (last != nullptr) last->replies.reset();
}

Result<std::unique_ptr<QueryClient>> QueryClient::Create(wire::Bus& bus, const QueryClientOptions& options) {
  std::unique_ptr<QueryClient> client(new QueryClient(bus, options));
  auto wire = client->Connect(bus);
  if (!wire) return tl::unexpected(wire.error());
  const MutexLock lock(client->mutex_);
  client->wire_ = std::move(*wire);
  return client;
}

Result<std::shared_ptr<QueryClient::Wire>> QueryClient::Connect(wire::Bus& bus) {
  auto wire = std::make_shared<Wire>();
  wire->bus = &bus;
  wire->client = NewClientId();
  wire::SubscriptionEvents events;
  events.matched = [this](int matched) {
    const MutexLock lock(mutex_);
    if (matched == 0) server_found_ = false;
    changed_.NotifyAll();
  };
  auto replies = bus.SubscribeReplies(
      wire->client, [this](Reply&& part) { OnReply(std::move(part)); }, std::move(events));
  if (!replies) return tl::unexpected(replies.error());
  wire->replies = std::move(*replies);
  auto requests = bus.Advertise<Request>();
  if (!requests) return tl::unexpected(requests.error());
  wire->requests = std::move(*requests);
  wire->commands = bus.Advertise<Command>();
  if (!wire->commands && wire->commands.error().code != StatusCode::kPermissionDenied)
    return tl::unexpected(wire->commands.error());
  return wire;
}

Result<void> QueryClient::Wire::Publish(const Request& request) const {
  if (!IsCommand(request.kind)) return requests->Publish(request);
  if (!commands) return tl::unexpected(commands.error());
  return (*commands)->Publish({request});
}

std::shared_ptr<QueryClient::Wire> QueryClient::CurrentWire() {
  const MutexLock lock(mutex_);
  return wire_;
}

int QueryClient::renewed() const {
  const MutexLock lock(mutex_);
  return times_renewed_;
}

void QueryClient::OnReply(Reply&& part) {
  const MutexLock lock(mutex_);
  last_answer_ = Clock::now();
  const auto pending = pending_.find(part.sequence);
  if (pending == pending_.end()) return;  // The caller has stopped waiting.
  pending->second.Add(std::move(part));
  changed_.NotifyAll();
}

Result<Reply> QueryClient::Ask(const Request& request) {
  const Deadline deadline = DeadlineAfter(options_.timeout_s);
  const bool command = IsCommand(request.kind);
  if (const auto wire = CurrentWire(); command && !wire->commands) return tl::unexpected(wire->commands.error());
  // A command that is late may have been carried out.
  const bool repeatable = !command;
  for (Clock::duration patience = MayBeDeaf() ? kHostileFirstPatience : kFirstPatience;; patience *= 2) {
    if (auto found = WaitForServer(command, deadline); !found) return tl::unexpected(found.error());
    const Deadline begun = repeatable ? std::min(deadline, Clock::now() + patience) : deadline;
    Result<Reply> reply = Exchange(request, begun, deadline, kOnce);
    if (reply && !reply->status.ok()) return tl::unexpected(reply->status);
    if (reply || reply.error().code != StatusCode::kDeadlineExceeded || Clock::now() >= deadline) return reply;
  }
}

// Whether a server that takes commands is known here.
bool QueryClient::CommandsMatched() const {
  return wire_->commands && (*wire_->commands)->matched() > 0;
}

// DDS matches the topic of requests and the topic of replies one after the other, on both sides. Until all four ends
// have found their peers, an answer may be lost. Only an answered ping proves that they have; a ping may be repeated,
// while a question that starts a job may not. One thread sends pings for all that wait: four hundred of them kept the
// server too busy to answer.
Result<void> QueryClient::WaitForServer(bool command, Deadline deadline) {
  const bool secure = !bus_.options().security.empty();
  Deadline began = Clock::now();  // Since when pings are not answered.
  for (;;) {
    bool matched = false, pings = false;
    {
      const MutexLock lock(mutex_);
      if (server_found_ && (!command || CommandsMatched())) return {};
      matched = wire_->requests->matched() > 0 && wire_->replies->matched() > 0 && (!command || CommandsMatched());
      if (matched) alone_since_.reset();
      if (!matched && !alone_since_) alone_since_ = Clock::now();
      pings = matched && !std::exchange(pinging_, true);
      const auto patience = matched ? kPingPatience : std::chrono::milliseconds(5);
      if (!pings) changed_.WaitUntil(mutex_, std::min(deadline, Clock::now() + patience));
    }
    if (!matched) {
      began = Clock::now();
      RenewIfAlone(secure);
    } else if (pings && PingOnce(began, deadline)) {
      return {};
    }
    if (Clock::now() >= deadline) return Fail(StatusCode::kUnavailable, NoServer(bus_, options_.timeout_s));
  }
}

// `began`: see WaitForServer. Whether the server has answered.
bool QueryClient::PingOnce(Deadline began, Deadline deadline) {
  struct Turn {
    QueryClient& client;
    ~Turn() {
      const MutexLock lock(client.mutex_);
      client.pinging_ = false;
      client.changed_.NotifyAll();
    }
  };
  const Turn turn{*this};
  const Deadline soon = std::min(deadline, Clock::now() + kPingPatience);
  const Result<Reply> pong = Exchange(MakeRequest(RequestKind::kPing), soon, soon, kPingEvery);
  if (!pong) {
    RenewIfSilent(began, kAnswerPatience);
    return false;
  }
  const MutexLock lock(mutex_);
  server_found_ = true;
  renewal_pause_ = std::chrono::seconds(1);
  return true;
}

Result<Reply> QueryClient::Exchange(Request request, Deadline begun, Deadline deadline, Deadline::duration every) {
  const std::shared_ptr<Wire> wire = CurrentWire();
  request.client = wire->client;
  {
    const MutexLock lock(mutex_);
    request.sequence = ++sequence_;
    pending_.try_emplace(request.sequence);
  }
  for (;;) {
    const Result<void> published = wire->Publish(request);
    const Deadline again = every == kOnce ? begun : std::min(begun, Clock::now() + every);
    const MutexLock lock(mutex_);
    const auto pending = pending_.find(request.sequence);
    const auto until = [&] { return pending->second.parts() > 0 ? deadline : again; };
    while (published && !pending->second.complete() && Clock::now() < until()) changed_.WaitUntil(mutex_, until());
    if (published && pending->second.parts() == 0 && Clock::now() < begun) continue;
    auto node = pending_.extract(pending);
    if (node.mapped().complete()) return node.mapped().Take();
    if (!published) return tl::unexpected(published.error());
    server_found_ = false;
    return Fail(StatusCode::kDeadlineExceeded,
                fmt::format("no {}answer to {} within {:.1f} s", node.mapped().parts() > 0 ? "complete " : "",
                            RequestKindName(request.kind), options_.timeout_s));
  }
}

Result<std::string> QueryClient::Ping() {
  return Ask(MakeRequest(RequestKind::kPing)).map([](Reply&& reply) { return std::move(reply.server_version); });
}

Result<PoseReport> QueryClient::Pose(const std::string& robot, std::optional<Stamp> at) {
  Request request = AboutRobot(RequestKind::kPose, robot);
  request.latest = !at.has_value();
  request.stamp = at.value_or(0);
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.poses), "poses"); });
}

Result<PathAnswer> QueryClient::Path(const std::string& robot, bool smoothed) {
  Request request = AboutRobot(RequestKind::kPath, robot);
  request.smoothed = smoothed;
  return Ask(request).map([](Reply&& reply) { return PathAnswer{std::move(reply.path), reply.map_epoch}; });
}

Result<StatusAnswer> QueryClient::ServerStatus(const std::string& robot) {
  return Ask(AboutRobot(RequestKind::kStatus, robot)).map([](Reply&& reply) {
    return StatusAnswer{std::move(reply.robots), std::move(reply.status.message),
                        reply.refused.empty() ? Refusals{} : reply.refused.front()};
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

Result<void> QueryClient::Relocalise(const std::string& robot, const std::optional<Pose2>& T_map_robot) {
  Request request = AboutRobot(RequestKind::kRelocalise, robot);
  request.T_map_robot = T_map_robot;
  return Ask(request).map([](Reply&&) {});
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
  return Ask(request).map([](Reply&& reply) {
    return TileAnswer{reply.generation, reply.map_epoch, reply.map_version, std::move(reply.tiles)};
  });
}

Result<OccupancyImage> QueryClient::MapImage(const std::string& site) {
  auto info = Map(site);
  if (!info) return tl::unexpected(info.error());
  TileQuery query;
  query.site = site;
  const auto answer = Tiles(query);
  if (!answer) return tl::unexpected(answer.error());
  if (answer->tiles.empty()) return Fail(StatusCode::kUnavailable, fmt::format("site '{}' has no tile yet", site));
  return AssembleTiles(answer->tiles, info->resolution_m);
}

Result<std::vector<LandmarkReport>> QueryClient::Landmarks(const std::string& site, const Area& area) {
  Request request = AboutSite(RequestKind::kLandmarks, site);
  request.area = area;
  return Ask(request).map([](Reply&& reply) { return std::move(reply.landmarks); });
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
