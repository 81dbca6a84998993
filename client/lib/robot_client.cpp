#include "client/lib/robot_client.h"

#include <fmt/format.h>

#include <utility>

#include "client/lib/client_id.h"
#include "client/lib/deadline.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

// Odometry belongs to the robot and not to one of its lasers, so its stream has a name of its own.
constexpr char kOdometrySensor[] = "odometry";

}  // namespace

RobotClient::RobotClient(SessionRequest request, Callbacks callbacks, const RobotClientOptions& options)
    : request_(std::move(request)),
      robot_id_(HashName(request_.robot)),
      callbacks_(std::move(callbacks)),
      options_(options),
      progress_(Clock::now()) {
  request_.client = NewClientId();
  for (const std::string& sensor : request_.sensors) streams_.try_emplace(HashName(sensor), options.window);
}

Result<std::unique_ptr<RobotClient>> RobotClient::Open(wire::Bus& bus, SessionRequest request, double timeout_s,
                                                       Callbacks callbacks, const RobotClientOptions& options) {
  if (request.sensors.empty()) return Fail(StatusCode::kInvalidArgument, "a session needs at least one sensor");
  std::unique_ptr<RobotClient> client(new RobotClient(std::move(request), std::move(callbacks), options));
  if (auto connected = client->Connect(bus); !connected) return tl::unexpected(connected.error());
  if (auto opened = client->AwaitSession(bus, timeout_s); !opened) return tl::unexpected(opened.error());
  client->watcher_ = std::thread([self = client.get()] { self->Watch(); });
  return client;
}

RobotClient::~RobotClient() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    changed_.NotifyAll();
  }
  if (watcher_.joinable()) watcher_.join();
  subscriptions_.clear();
}

Result<void> RobotClient::Connect(wire::Bus& bus) {
  const auto keep = [this](auto subscription) -> Result<void> {
    if (!subscription) return tl::unexpected(subscription.error());
    subscriptions_.push_back(std::move(*subscription));
    return {};
  };
  // Subscriptions first, so that no answer is missed.
  if (auto kept = keep(bus.Subscribe<SessionState>([this](SessionState&& s) { OnSession(std::move(s)); })); !kept) {
    return kept;
  }
  if (auto kept = keep(bus.Subscribe<Ledger>([this](Ledger&& l) { OnLedger(std::move(l)); })); !kept) return kept;
  if (auto kept = keep(bus.Subscribe<PoseReport>([this](PoseReport&& p) { OnPose(std::move(p)); })); !kept) return kept;
  const auto advertise = [&bus](auto& publication) -> Result<void> {
    using Value = typename std::remove_reference_t<decltype(*publication)>::ValueType;
    auto made = bus.Advertise<Value>();
    if (!made) return tl::unexpected(made.error());
    publication = std::move(*made);
    return {};
  };
  if (auto made = advertise(scans_); !made) return made;
  if (auto made = advertise(odometry_); !made) return made;
  if (auto made = advertise(session_); !made) return made;
  return session_->Publish(request_);  // Kept for a server that comes later.
}

Result<void> RobotClient::AwaitSession(const wire::Bus& bus, double timeout_s) {
  const auto deadline = DeadlineAfter(timeout_s);
  const MutexLock lock(mutex_);
  // The streams must have found the server as well: what is sent before that is lost.
  while (!state_ || (state_->phase == SessionPhase::kActive && (scans_->matched() == 0 || odometry_->matched() == 0))) {
    if (Clock::now() >= deadline) return Fail(StatusCode::kUnavailable, NoServer(bus, timeout_s));
    changed_.WaitFor(mutex_, std::chrono::milliseconds(5));
  }
  if (state_->phase == SessionPhase::kActive) return {};
  if (!state_->status.ok()) return tl::unexpected(state_->status);
  return Fail(StatusCode::kFailedPrecondition, fmt::format("the session of '{}' is not active", request_.robot));
}

void RobotClient::OnSession(SessionState&& state) {
  if (state.robot_id != robot_id_ || state.client != request_.client) return;
  {
    const MutexLock lock(mutex_);
    // The state is published again after one side was away: a new server, or a lease that ran out.
    if (state.phase == SessionPhase::kActive && state_) resend_ = true;
    state_ = state;
    changed_.NotifyAll();
  }
  if (callbacks_.session) callbacks_.session(state);
}

void RobotClient::OnLedger(Ledger&& ledger) {
  if (ledger.robot_id != robot_id_) return;
  {
    const MutexLock lock(mutex_);
    const auto stream = streams_.find(ledger.sensor_id);
    if (stream == streams_.end()) return;
    const std::uint64_t before = stream->second.window.settled_through();
    stream->second.window.OnLedger(ledger);
    if (stream->second.window.settled_through() != before) progress_ = Clock::now();
    stream->second.ledger = ledger;
    changed_.NotifyAll();
  }
  if (callbacks_.ledger) callbacks_.ledger(ledger);
}

void RobotClient::OnPose(PoseReport&& report) {
  if (report.robot_id != robot_id_) return;
  {
    const MutexLock lock(mutex_);
    pose_ = report;
  }
  if (callbacks_.pose) callbacks_.pose(report);
}

Result<void> RobotClient::AwaitRoom(const Stream& stream) {
  const auto deadline = DeadlineAfter(options_.send_timeout_s);
  for (;;) {
    const bool over = state_->phase == SessionPhase::kRefused || state_->phase == SessionPhase::kEnded;
    if (over && !state_->status.ok()) return tl::unexpected(state_->status);
    if (over)
      return Fail(StatusCode::kFailedPrecondition, fmt::format("the session of '{}' has ended", request_.robot));
    if (stream.window.HasRoom()) return {};
    if (Clock::now() >= deadline) {
      return Fail(StatusCode::kUnavailable,
                  fmt::format("the server settled no scan of '{}' for {:.1f} s ({} sent, {} settled)", request_.robot,
                              options_.send_timeout_s, stream.window.sent(), stream.window.settled_through()));
    }
    changed_.WaitUntil(mutex_, deadline);
  }
}

Result<void> RobotClient::Publish(const Scan& scan) {
  return Publish(scan, request_.sensors.front());
}

Result<void> RobotClient::Publish(const Scan& scan, const std::string& sensor) {
  const NameId sensor_id = HashName(sensor);
  const ScanSample sample{{robot_id_, sensor_id, request_.client}, scan};
  for (;;) {
    {
      const MutexLock lock(mutex_);
      const auto stream = streams_.find(sensor_id);
      if (stream == streams_.end()) {
        return Fail(StatusCode::kInvalidArgument, fmt::format("sensor '{}' is not part of the session", sensor));
      }
      if (auto room = AwaitRoom(stream->second); !room) return room;
    }
    const MutexLock sending(sending_);
    ScanWindow::Kept kept;
    {
      const MutexLock lock(mutex_);
      ScanWindow& window = streams_.find(sensor_id)->second.window;
      if (!window.HasRoom()) continue;  // Another thread was faster.
      if (window.settled()) progress_ = Clock::now();
      kept = window.Add(ScanSample(sample));
    }
    auto published = scans_->Publish(*kept);
    // Where the writer was busy, the watcher sends the scan again, because it is kept. A scan that can never be sent is
    // the caller's error.
    if (!published && published.error().code != StatusCode::kUnavailable) return published;
    return {};
  }
}

Result<void> RobotClient::Publish(const Odometry& odometry) {
  OdometrySample sample{{robot_id_, HashName(kOdometrySensor), request_.client}, odometry};
  {
    const MutexLock lock(mutex_);
    if (sample.odometry.sequence == 0) sample.odometry.sequence = odometry_sequence_ + 1;
    odometry_sequence_ = sample.odometry.sequence;
  }
  return odometry_->Publish(sample);
}

Result<void> RobotClient::WaitSettled(double timeout_s) {
  const auto deadline = DeadlineAfter(timeout_s);
  const MutexLock lock(mutex_);
  for (const auto& [sensor, stream] : streams_) {
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

Result<void> RobotClient::End(double timeout_s) {
  SessionRequest end = request_;
  end.end = true;
  if (auto published = session_->Publish(end); !published) return published;
  const auto deadline = DeadlineAfter(timeout_s);
  const MutexLock lock(mutex_);
  while (state_->phase != SessionPhase::kEnded) {
    if (Clock::now() >= deadline) {
      return Fail(StatusCode::kDeadlineExceeded,
                  fmt::format("the server did not end the session of '{}' within {:.1f} s", request_.robot, timeout_s));
    }
    changed_.WaitUntil(mutex_, deadline);
  }
  return {};
}

// Runs until the client is destroyed: sends kept scans again after the session was resumed, or when none of them was
// settled for resend_after_s.
void RobotClient::Watch() {
  for (;;) {
    {
      const MutexLock lock(mutex_);
      changed_.WaitFor(mutex_, std::chrono::milliseconds(100));
      if (stopping_) return;
      bool waiting = false;
      for (const auto& [sensor, stream] : streams_) waiting = waiting || !stream.window.settled();
      const bool stuck = waiting && Clock::now() - progress_ > std::chrono::duration<double>(options_.resend_after_s);
      if (state_->phase != SessionPhase::kActive || !(resend_ || stuck)) continue;
      resend_ = false;
      progress_ = Clock::now();
    }
    if (session_->matched() > 0 && scans_->matched() > 0) Resend();
  }
}

void RobotClient::Resend() {
  // Less than the writer's depth, so that nothing is overwritten before it has arrived.
  constexpr int kBurst = 32;
  constexpr std::chrono::milliseconds kBurstTime{1000};
  const MutexLock sending(sending_);
  std::vector<ScanWindow::Kept> kept;
  {
    const MutexLock lock(mutex_);
    for (const auto& [sensor, stream] : streams_) {
      for (ScanWindow::Kept& sample : stream.window.kept()) kept.push_back(std::move(sample));
    }
  }
  int burst = 0;
  for (const ScanWindow::Kept& sample : kept) {
    {
      const MutexLock lock(mutex_);
      if (stopping_) return;
    }
    // Counted first: the server may settle the sample before Publish returns.
    resent_.fetch_add(1, std::memory_order_relaxed);
    if (!scans_->Publish(*sample)) {
      resent_.fetch_sub(1, std::memory_order_relaxed);
      return;  // The writer is still blocked; Watch tries again.
    }
    if (++burst % kBurst == 0) static_cast<void>(scans_->WaitForAcknowledgement(kBurstTime));
  }
}

SessionState RobotClient::session() const {
  const MutexLock lock(mutex_);
  return *state_;
}

std::optional<PoseReport> RobotClient::pose() const {
  const MutexLock lock(mutex_);
  return pose_;
}

std::optional<Ledger> RobotClient::ledger() const {
  return ledger(request_.sensors.front());
}

std::optional<Ledger> RobotClient::ledger(const std::string& sensor) const {
  const MutexLock lock(mutex_);
  const auto stream = streams_.find(HashName(sensor));
  return stream == streams_.end() ? std::nullopt : stream->second.ledger;
}

}  // namespace cairn::client
