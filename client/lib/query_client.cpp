#include "client/lib/query_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "client/lib/client_id.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

// The answer's only element, which a server that says OK must give.
template <typename T>
Result<T> Only(std::vector<T>&& list, const char* what) {
  if (list.size() != 1) {
    return Fail(StatusCode::kInternal, fmt::format("the server answered with {} {} instead of one", list.size(), what));
  }
  return std::move(list.front());
}

Request Of(RequestKind kind) {
  Request request;
  request.kind = kind;
  return request;
}

}  // namespace

QueryClient::QueryClient(wire::Bus& bus, const QueryClientOptions& options)
    : bus_(bus), options_(options), id_(NewClientId()) {}

QueryClient::~QueryClient() = default;

Result<std::unique_ptr<QueryClient>> QueryClient::Create(wire::Bus& bus, const QueryClientOptions& options) {
  std::unique_ptr<QueryClient> client(new QueryClient(bus, options));
  wire::SubscriptionEvents events;
  events.matched = [self = client.get()](int matched) {
    const MutexLock lock(self->mutex_);
    if (matched == 0) self->greeted_ = false;
    self->changed_.NotifyAll();
  };
  auto replies = bus.SubscribeReplies(
      client->id_, [self = client.get()](Reply&& part) { self->OnReply(std::move(part)); }, std::move(events));
  if (!replies) return tl::unexpected(replies.error());
  client->replies_ = std::move(*replies);
  auto requests = bus.Advertise<Request>();
  if (!requests) return tl::unexpected(requests.error());
  client->requests_ = std::move(*requests);
  return client;
}

void QueryClient::OnReply(Reply&& part) {
  const MutexLock lock(mutex_);
  const auto pending = pending_.find(part.sequence);
  if (pending == pending_.end()) return;  // Too late, or for an earlier life of this id.
  pending->second.Add(std::move(part));
  changed_.NotifyAll();
}

Result<Reply> QueryClient::Ask(const Request& request, double timeout_s) {
  const Deadline deadline =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout_s));
  if (auto greeted = Greet(deadline, timeout_s); !greeted) return tl::unexpected(greeted.error());
  Result<Reply> reply = AskOnce(request, deadline, timeout_s);
  if (reply && !reply->status.ok()) return tl::unexpected(reply->status);
  return reply;
}

// Both sides must have found each other's both ends, and only an answer proves that: without it the reply to the first
// question would go nowhere. A ping may be asked twice, a job may not.
Result<void> QueryClient::Greet(Deadline deadline, double timeout_s) {
  constexpr std::chrono::milliseconds kPatience{100};
  for (;;) {
    {
      const MutexLock lock(mutex_);
      if (greeted_) return {};
      while (requests_->matched() == 0 || replies_->matched() == 0) {
        if (Clock::now() >= deadline) return Fail(StatusCode::kUnavailable, NoServer(bus_, timeout_s));
        changed_.WaitFor(mutex_, std::chrono::milliseconds(5));
      }
    }
    const Result<Reply> pong = AskOnce(Of(RequestKind::kPing), std::min(deadline, Clock::now() + kPatience), timeout_s);
    const MutexLock lock(mutex_);
    if (pong) {
      greeted_ = true;
      return {};
    }
    if (Clock::now() >= deadline) return Fail(StatusCode::kUnavailable, NoServer(bus_, timeout_s));
  }
}

Result<Reply> QueryClient::AskOnce(Request request, Deadline deadline, double timeout_s) {
  request.client = id_;
  {
    const MutexLock lock(mutex_);
    request.sequence = ++sequence_;
    pending_.try_emplace(request.sequence);
  }
  const Result<void> published = requests_->Publish(request);
  const MutexLock lock(mutex_);
  const auto pending = pending_.find(request.sequence);
  while (published && !pending->second.complete() && Clock::now() < deadline) changed_.WaitUntil(mutex_, deadline);
  auto node = pending_.extract(pending);
  if (!published) return tl::unexpected(published.error());
  if (node.mapped().complete()) return node.mapped().Take();
  return Fail(StatusCode::kDeadlineExceeded,
              fmt::format("no {} answer to {} within {:.1f} s", node.mapped().parts() > 0 ? "complete" : "",
                          RequestKindName(request.kind), timeout_s));
}

Result<std::string> QueryClient::Ping() {
  return Ask(Of(RequestKind::kPing)).map([](Reply&& reply) { return std::move(reply.server_version); });
}

Result<PoseReport> QueryClient::Pose(const std::string& robot, std::optional<Stamp> at) {
  Request request = Of(RequestKind::kPose);
  request.robot = robot;
  request.latest = !at.has_value();
  request.stamp = at.value_or(0);
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.poses), "poses"); });
}

Result<Trajectory> QueryClient::Path(const std::string& robot, bool smoothed) {
  Request request = Of(RequestKind::kPath);
  request.robot = robot;
  request.smoothed = smoothed;
  return Ask(request).map([](Reply&& reply) { return std::move(reply.path); });
}

Result<TileAnswer> QueryClient::Tiles(const TileQuery& query) {
  Request request = Of(RequestKind::kTiles);
  request.site = query.site;
  request.area = query.area;
  request.level = query.level;
  request.since_epoch = query.since_epoch;
  request.since_version = query.since_version;
  return Ask(request).map([](Reply&& reply) {
    return TileAnswer{reply.map_epoch, reply.map_version, std::move(reply.tiles)};
  });
}

Result<std::vector<LandmarkReport>> QueryClient::Landmarks(const std::string& site, const Area& area) {
  Request request = Of(RequestKind::kLandmarks);
  request.site = site;
  request.area = area;
  return Ask(request).map([](Reply&& reply) { return std::move(reply.landmarks); });
}

Result<std::vector<MapInfo>> QueryClient::Maps(const std::string& site) {
  Request request = Of(RequestKind::kMapInfo);
  request.site = site;
  return Ask(request).map([](Reply&& reply) { return std::move(reply.maps); });
}

Result<std::vector<RobotStatus>> QueryClient::Robots(const std::string& robot) {
  Request request = Of(RequestKind::kStatus);
  request.robot = robot;
  return Ask(request).map([](Reply&& reply) { return std::move(reply.robots); });
}

Result<Job> QueryClient::SubmitJob(const std::string& site, JobKind kind, bool enable) {
  Request request = Of(RequestKind::kJobSubmit);
  request.site = site;
  request.job_kind = kind;
  request.enable = enable;
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.jobs), "jobs"); });
}

Result<Job> QueryClient::GetJob(std::uint64_t id) {
  Request request = Of(RequestKind::kJobGet);
  request.job = id;
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.jobs), "jobs"); });
}

Result<Job> QueryClient::CancelJob(std::uint64_t id) {
  Request request = Of(RequestKind::kJobCancel);
  request.job = id;
  return Ask(request).and_then([](Reply&& reply) { return Only(std::move(reply.jobs), "jobs"); });
}

Result<std::vector<Job>> QueryClient::Jobs(const std::string& site) {
  Request request = Of(RequestKind::kJobList);
  request.site = site;
  return Ask(request).map([](Reply&& reply) { return std::move(reply.jobs); });
}

Result<void> QueryClient::EndSession(const std::string& robot) {
  Request request = Of(RequestKind::kSessionEnd);
  request.robot = robot;
  if (const Result<Reply> reply = Ask(request); !reply) return tl::unexpected(reply.error());
  return {};
}

Result<void> QueryClient::EnableMap(const std::string& site, std::uint32_t map_version) {
  Request request = Of(RequestKind::kMapEnable);
  request.site = site;
  request.map_version = map_version;
  if (const Result<Reply> reply = Ask(request); !reply) return tl::unexpected(reply.error());
  return {};
}

}  // namespace cairn::client
