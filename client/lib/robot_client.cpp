#include "client/lib/robot_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "client/lib/client_id.h"
#include "client/lib/deadline.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kAskPeriod{1};               // Between two requests without an answer.
constexpr std::chrono::milliseconds kUrgentAskPeriod{300};  // The same while the session is stale.

// Errors that may be gone when the client asks again.
bool IsTemporary(StatusCode code) {
  return code == StatusCode::kUnavailable || code == StatusCode::kResourceExhausted;
}

}  // namespace

RobotClient::RobotClient(SessionRequest request, Callbacks callbacks, const RobotClientOptions& options)
    : client_(NewClientId()),
      robot_(request.robot),
      robot_id_(HashName(request.robot)),
      callbacks_(std::move(callbacks)),
      options_(options),
      request_(std::move(request)),
      backlog_(options.max_kept_bytes),
      progress_(Clock::now()),
      answered_at_(progress_),
      connected_at_(progress_),
      renewal_pause_(0) {
  const MutexLock lock(mutex_);
  request_.client = client_;
  request_.session = NewClientId();
  request_.started = request_.end = false;
  for (const std::string& sensor : request_.sensors) streams_.try_emplace(HashName(sensor), options.window);
  streams_.try_emplace(HashName(kOdometrySensor), 0);
}

Result<std::unique_ptr<RobotClient>> RobotClient::Open(wire::Bus& bus, SessionRequest request, double timeout_s,
                                                       Callbacks callbacks, const RobotClientOptions& options) {
  if (request.sensors.empty()) return Fail(StatusCode::kInvalidArgument, "a session needs at least one sensor");
  std::unique_ptr<RobotClient> client(new RobotClient(std::move(request), std::move(callbacks), options));
  if (!options.spill_file.empty()) {
    auto file = SpillFile::Create(options.spill_file);
    if (!file) return tl::unexpected(file.error());
    const MutexLock lock(client->mutex_);
    client->backlog_.SpillTo(std::move(*file));
  }
  if (auto connected = client->Connect(bus); !connected) return tl::unexpected(connected.error());
  if (auto opened = client->AwaitSession(bus, timeout_s); !opened) return tl::unexpected(opened.error());
  client->watcher_ = std::thread([self = client.get()] { self->Watch(); });
  return client;
}

RobotClient::~RobotClient() {
  std::shared_ptr<Wire> last;  // Its callbacks take the mutex.
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    last = wire_;
    changed_.NotifyAll();
  }
  if (watcher_.joinable()) watcher_.join();
  retired_.clear();
  if (last != nullptr) last->subscriptions.clear();
}

Result<void> RobotClient::Connect(wire::Bus& bus) {
  const auto wire = std::make_shared<Wire>();
  wire->bus = &bus;
  if (auto advertised = Advertise(*wire); !advertised) return advertised;
  {
    const MutexLock lock(mutex_);
    wire_ = wire;
  }
  // Subscriptions before the request, so that no answer is missed.
  if (auto subscribed = Subscribe(*wire); !subscribed) return subscribed;
  Ask();  // The middleware keeps the request for a server that starts later.
  return {};
}

Result<void> RobotClient::AwaitSession(const wire::Bus& bus, double timeout_s) {
  const auto deadline = DeadlineAfter(timeout_s);
  for (;;) {
    {
      const MutexLock lock(mutex_);
      if (over_) return tl::unexpected(*over_);
      if (state_ && state_->phase == SessionPhase::kEnded)
        return Fail(StatusCode::kFailedPrecondition, fmt::format("the session of '{}' is not active", request_.robot));
      if (!MustTellFrame()) {
        // The writers of the streams must have matched too: samples sent before are lost.
        if (Streaming()) return {};
        if (Clock::now() >= deadline) {
          if (not_yet_) return tl::unexpected(*not_yet_);
          return Fail(StatusCode::kUnavailable, NoServer(bus, timeout_s));
        }
        changed_.WaitFor(mutex_, std::chrono::milliseconds(5));
        if (Answered() || Clock::now() - asked_ < kAskPeriod) continue;
      }
    }
    Ask();
  }
}

// Publishes the request as it is now.
void RobotClient::Ask() {
  SessionRequest request;
  std::shared_ptr<Wire> wire;
  {
    const MutexLock lock(mutex_);
    request = request_;
    asked_ = Clock::now();
    told_frame_ = request_.map_frame;
    wire = wire_;
  }
  static_cast<void>(wire->session->Publish(request));  // If it is not accepted, Watch asks again.
}

bool RobotClient::Answered() const {
  return answered_ && state_->phase != SessionPhase::kSuspended && state_->generation == generation_;
}

bool RobotClient::MustTellFrame() const {
  return Answered() && !request_.started && told_frame_ != request_.map_frame;
}

bool RobotClient::Streaming() const {
  return Answered() && !over_ && !reopening_ && state_->phase == SessionPhase::kActive && wire_->scans->matched() > 0 &&
         wire_->odometry->matched() > 0;
}

void RobotClient::OnMatched(int servers) {
  const MutexLock lock(mutex_);
  if (servers == 0) {
    answered_ = false;
    not_yet_.reset();
  }
  changed_.NotifyAll();
}

void RobotClient::OnSession(SessionState&& state) {
  if (state.robot_id != robot_id_) return;
  {
    const MutexLock lock(mutex_);
    if (state.generation < generation_) return;
    if (state.session != request_.session) {
      // The robot now has another session than the one that was open.
      if (Answered() && state.generation == generation_ && state.phase == SessionPhase::kActive) {
        over_ = {StatusCode::kAlreadyExists,
                 fmt::format("another client has taken over the session of '{}'", request_.robot)};
        changed_.NotifyAll();
      }
      return;
    }
    generation_ = state.generation;
    // The server or this client was not reachable: samples that are not safe are sent again.
    if (!Answered()) {
      sent_before_ = backlog_.size() - backlog_.unsent();
      backlog_.Rewind();
      progress_ = Clock::now();
    }
    if (state.stale && !(state_ && state_->stale)) called_stale_ = Clock::now();
    KeepMapFrame(state);
    state_ = state;
    answered_ = true;
    not_yet_.reset();
    changed_.NotifyAll();
  }
  if (callbacks_.session) callbacks_.session(state);
}

// The start was believed in this map. If the server dies before the first sample and its state is lost, the next one
// must know this: the other robots come back with their places in the same map. A server renames the frame of a map
// that is not begun yet when a robot comes back with another one. The middleware keeps the newest request for the next
// server, so that it is published once more with the frame (MustTellFrame).
void RobotClient::KeepMapFrame(const SessionState& state) {
  if (!request_.has_start || state.phase != SessionPhase::kActive) return;
  const bool renamed = state_ && state_->generation == state.generation && state_->map_frame == request_.map_frame;
  if (request_.map_frame == 0 || renamed) request_.map_frame = state.map_frame;
}

void RobotClient::OnRefusal(SessionRefusal&& refusal) {
  SessionState& state = refusal.state;
  if (state.robot_id != robot_id_ || state.client != client_) return;
  {
    const MutexLock lock(mutex_);
    if (state.generation < generation_ || state.session != request_.session) return;
    generation_ = state.generation;
    answered_at_ = Clock::now();
    if (IsTemporary(state.status.code)) {
      not_yet_ = state.status;
      return;
    }
    if (request_.started && !request_.end && state.status.code == StatusCode::kFailedPrecondition) {
      if (!std::exchange(reopening_, true)) refused_ = Clock::now();
    } else {
      over_ = state.status;
    }
    changed_.NotifyAll();
  }
  if (callbacks_.session) callbacks_.session(state);
}

void RobotClient::OnLedger(Ledger&& ledger) {
  if (ledger.robot_id != robot_id_) return;
  {
    const MutexLock lock(mutex_);
    const auto found = streams_.find(ledger.sensor_id);
    // A ledger of another session counts other samples, and one that came before the session's state waits for it.
    if (found == streams_.end() || !state_ || ledger.session != request_.session || ledger.generation < generation_)
      return;
    generation_ = ledger.generation;
    Stream& stream = found->second;
    // A damaged number may have come through: what was never sent is not safe on the server.
    for (std::uint64_t* const number : {&ledger.settled_through, &ledger.durable_through, &ledger.last_sequence})
      *number = std::min(*number, stream.window.sent());
    const std::uint64_t before = stream.window.settled_through();
    stream.window.OnLedger(ledger);
    if (stream.window.settled_through() != before) {
      progress_ = Clock::now();
      pace_ = kFirstPace / 2;
    }
    stream.ledger = ledger;
    scans_used_ |= ledger.used > 0 && ledger.sensor_id != HashName(kOdometrySensor);
    Arrived(stream, ledger.last_sequence);
    // A server that does not know the session settles its samples as well: it drops them.
    if (ledger.generation == state_->generation)
      backlog_.Safe(ledger.sensor_id, state_->durable ? ledger.durable_through : ledger.settled_through);
    changed_.NotifyAll();
  }
  if (callbacks_.ledger) callbacks_.ledger(ledger);
}

void RobotClient::OnPose(PoseReport&& report) {
  if (report.robot_id != robot_id_) return;
  {
    const MutexLock lock(mutex_);
    // The last pose of another client, or of another robot with this name, may still be on the wire.
    if (report.generation < generation_ || !state_ || report.session != request_.session) return;
    pose_ = report;
  }
  if (callbacks_.pose) callbacks_.pose(report);
}

Result<void> RobotClient::WaitSettled(double timeout_s) {
  const auto deadline = DeadlineAfter(timeout_s);
  const MutexLock lock(mutex_);
  for (const auto& [sensor, stream] : streams_) {
    if (sensor == HashName(kOdometrySensor)) continue;
    while (!stream.window.settled()) {
      if (Clock::now() >= deadline) {
        return Fail(StatusCode::kDeadlineExceeded,
                    fmt::format("{} of {} scans settled within {:.1f} s", stream.window.settled_through(),
                                stream.window.sent(), timeout_s));
      }
      changed_.WaitUntil(mutex_, deadline);
    }
  }
  return {};
}

Result<void> RobotClient::WaitSafe(double timeout_s) {
  const auto deadline = DeadlineAfter(timeout_s);
  const MutexLock lock(mutex_);
  for (const auto& [sensor, stream] : streams_) {
    while (!IsSafe(stream)) {
      if (Clock::now() >= deadline)
        return Fail(StatusCode::kDeadlineExceeded, fmt::format("not everything is safe within {:.1f} s", timeout_s));
      changed_.WaitUntil(mutex_, deadline);
    }
  }
  return {};
}

bool RobotClient::IsSafe(const Stream& stream) const {
  if (stream.window.sent() == 0) return true;
  if (!stream.ledger || stream.ledger->session != request_.session) return false;
  return (state_->durable ? stream.ledger->durable_through : stream.ledger->settled_through) >= stream.window.sent();
}

Result<void> RobotClient::End(double timeout_s) {
  {
    const MutexLock lock(mutex_);
    request_.end = true;
  }
  const auto deadline = DeadlineAfter(timeout_s);
  Ask();
  for (;;) {
    {
      const MutexLock lock(mutex_);
      if (state_->phase == SessionPhase::kEnded) return {};
      if (over_) return tl::unexpected(*over_);
      if (Clock::now() >= deadline) {
        return Fail(
            StatusCode::kDeadlineExceeded,
            fmt::format("the server did not end the session of '{}' within {:.1f} s", request_.robot, timeout_s));
      }
      changed_.WaitUntil(mutex_, std::min(deadline, asked_ + kAskPeriod));
      if (Clock::now() - asked_ < kAskPeriod) continue;
    }
    Ask();
  }
}

// Runs until the client is destroyed. It repeats the request until it is answered, opens a new session if the server
// does not know this one, and sends samples that were not sent yet or that did not settle within resend_after_s.
void RobotClient::Watch() {
  for (;;) {
    bool ask = false;
    bool reopen = false;
    {
      const MutexLock lock(mutex_);
      if (!stopping_) changed_.WaitFor(mutex_, std::chrono::milliseconds(100));
      if (stopping_) return;
      const auto now = Clock::now();
      if (!Settled() && Streaming() && now - progress_ > std::chrono::duration<double>(options_.resend_after_s)) {
        sent_before_ = backlog_.size() - backlog_.unsent();
        backlog_.Rewind();
        progress_ = now;
        pace_ = std::min(2 * pace_, kLastPace);
        ask = true;  // The server may have forgotten the session, too.
      }
      reopen = reopening_ && ReadyToReopen();
      const bool over = over_ || state_->phase == SessionPhase::kEnded || reopening_;
      const auto period = stale_.empty() ? std::chrono::milliseconds(kAskPeriod) : kUrgentAskPeriod;
      ask = ask || MustTellFrame() || (!Answered() && !over && wire_->session->matched() > 0 && now - asked_ >= period);
    }
    Recover();
    if (reopen) Reopen();
    if (ask) Ask();
    Pump();
  }
}

SessionState RobotClient::session() const {
  const MutexLock lock(mutex_);
  SessionState state = *state_;
  state.session = request_.session;
  state.stale = state.stale || !stale_.empty();
  if (!stale_.empty()) state.status = {StatusCode::kUnavailable, "stale: " + stale_};
  if (over_) {
    state.phase = SessionPhase::kRefused;
    state.status = *over_;
  }
  return state;
}

std::optional<PoseReport> RobotClient::pose() const {
  const MutexLock lock(mutex_);
  return pose_;
}

std::optional<Ledger> RobotClient::ledger() const {
  const MutexLock lock(mutex_);
  return streams_.find(HashName(request_.sensors.front()))->second.ledger;
}

std::optional<Ledger> RobotClient::ledger(const std::string& sensor) const {
  const MutexLock lock(mutex_);
  const auto stream = streams_.find(HashName(sensor));
  return stream == streams_.end() ? std::nullopt : stream->second.ledger;
}

std::uint64_t RobotClient::displaced() const {
  const MutexLock lock(mutex_);
  return backlog_.displaced();
}

std::uint64_t RobotClient::spilled_bytes() const {
  const MutexLock lock(mutex_);
  return backlog_.spilled_bytes();
}

std::string RobotClient::spill_error() const {
  const MutexLock lock(mutex_);
  return backlog_.spill_error();
}

}  // namespace cairn::client
