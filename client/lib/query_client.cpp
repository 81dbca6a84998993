#include "client/lib/query_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "client/lib/client_id.h"
#include "client/lib/last_request.h"
#include "common/service/request_id.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kFirstPatience{2};   // For the first part of an answer; then the question is repeated.
constexpr std::chrono::seconds kAnswerPatience{1};  // Pings of a server that was found are not answered for so long.
constexpr std::chrono::seconds kHostileFirstPatience{1};  // Where forged messages may have made the client deaf.

constexpr std::chrono::milliseconds kPingPatience{100};  // For the answer to a ping; then a new one is begun.
constexpr std::chrono::milliseconds kPingEvery{20};      // Until then the same one is sent again.
constexpr std::chrono::steady_clock::duration kOnce{0};  // A question is not sent again.

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
  Request ping;
  ping.kind = RequestKind::kPing;
  const Result<Reply> pong = Exchange(std::move(ping), soon, soon, kPingEvery);
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
    if (published && every == kOnce) NoteRequest(request);
    const Deadline again = every == kOnce ? begun : std::min(begun, Clock::now() + every);
    const MutexLock lock(mutex_);
    const auto pending = pending_.find(request.sequence);
    const auto until = [&] { return pending->second.parts() > 0 ? deadline : again; };
    while (published && !pending->second.complete() && Clock::now() < until()) changed_.WaitUntil(mutex_, until());
    if (published && pending->second.parts() == 0 && Clock::now() < begun) continue;
    auto node = pending_.extract(pending);
    const std::string id = RequestId(request.client, request.sequence);
    if (node.mapped().complete()) {
      Reply reply = node.mapped().Take();
      if (!reply.status.ok()) reply.status.request = id;
      return reply;
    }
    if (!published) return tl::unexpected(published.error());
    server_found_ = false;
    return tl::unexpected(
        Status{StatusCode::kDeadlineExceeded,
               fmt::format("no {}answer to {} within {:.1f} s", node.mapped().parts() > 0 ? "complete " : "",
                           RequestKindName(request.kind), options_.timeout_s),
               id});
  }
}

}  // namespace cairn::client
