#include "client/cli/robot_stream.h"

#include <algorithm>
#include <utility>

namespace cairn::client {

Result<std::unique_ptr<RobotStream>> RobotStream::Open(Program& program, const StreamOptions& options) {
  const auto bus = program.bus();
  if (!bus) return tl::unexpected(bus.error());
  std::unique_ptr<RobotStream> stream(new RobotStream(options, program.options.timeout_s));
  SessionRequest request;
  request.robot = options.robot;
  request.site = options.site;
  request.sensors = options.sensors;
  request.has_start = options.T_map_robot_start.has_value();
  request.T_map_robot_start = options.T_map_robot_start.value_or(Pose2{});
  RobotClientOptions client_options;
  // The client counts those of each lidar by itself.
  client_options.window = options.window == 0 ? 0 : std::max<std::uint64_t>(1, options.window / options.sensors.size());
  client_options.spill_file = options.spill_file;
  client_options.send_timeout_s = program.options.timeout_s;
  RobotClient::Callbacks callbacks;
  callbacks.pose = [self = stream.get()](const PoseReport& pose) { self->OnPose(pose); };
  callbacks.restarted = [self = stream.get()](SessionToken session, const Pose2&) { self->OnRestart(session); };
  auto client = RobotClient::Open(**bus, request, program.options.timeout_s, std::move(callbacks), client_options);
  if (!client) return tl::unexpected(client.error());
  stream->client_ = std::move(*client);

  // A query and not a subscription: before the first scan of a stream, no ledger of it is published.
  const auto before = stream->AskLedgers(program);
  if (!before) return tl::unexpected(before.error());
  const std::lock_guard lock(stream->mutex_);
  if (stream->restarted_ == 0) {
    stream->session_ = stream->client_->session().session;
    stream->before_ = *before;
  }
  return stream;
}

Result<std::vector<Ledger>> RobotStream::AskLedgers(Program& program) const {
  const auto robots = program.Ask([&](QueryClient& server) { return server.Robots(options_.robot); });
  if (!robots) return tl::unexpected(robots.error());
  std::vector<Ledger> ledgers(options_.sensors.size());
  for (std::size_t i = 0; i < ledgers.size(); ++i) {
    ledgers[i].sensor = options_.sensors[i];
    for (const RobotStatus& robot : *robots) {
      for (const Ledger& stream : robot.ledgers) {
        if (stream.sensor == options_.sensors[i]) ledgers[i] = stream;
      }
    }
  }
  return ledgers;
}

void RobotStream::OnPose(const PoseReport& pose) {
  const auto now = Clock::now();
  const std::lock_guard lock(mutex_);
  Departure& departure = DepartureOf(pose.stamp);
  if (!departure.waiting || departure.stamp != pose.stamp) return;
  departure.waiting = false;
  latency_ms_.Add(std::chrono::duration<double, std::milli>(now - departure.time).count());
}

// Keyed by stamp, because a new session numbers the scans from 1 again.
RobotStream::Departure& RobotStream::DepartureOf(Stamp stamp) {
  return departures_[static_cast<std::uint64_t>(stamp) * 0x9E3779B97F4A7C15ULL % kRemembered];
}

ScanAccount RobotStream::AccountOfSession(std::uint64_t sent) const {
  ScanAccount account;
  account.sent = sent;
  for (std::size_t i = 0; i < options_.sensors.size(); ++i) {
    const std::optional<Ledger> ledger = client_->ledger(options_.sensors[i]);
    account.Add(AccountScans(0, before_[i], ledger && ledger->session == session_ ? *ledger : before_[i]));
  }
  return account;
}

// The samples that the old session settled stay counted. The others are sent again in the new session.
void RobotStream::OnRestart(SessionToken session) {
  const std::lock_guard lock(mutex_);
  closed_.Add(AccountOfSession(0));
  closed_.waiting = 0;
  before_.assign(options_.sensors.size(), {});
  session_ = session;
  ++restarted_;
}

// A robot would wait for its server. For a log or a simulation, a lost server is an error, unless the session is
// durable, so that the next server continues it.
Result<void> RobotStream::CheckServer() {
  const SessionState state = client_->session();
  if (state.phase == SessionPhase::kSuspended && state.status.code == StatusCode::kUnavailable && !state.durable)
    return Fail(StatusCode::kUnavailable, "the session is suspended: " + state.status.message);
  const auto now = Clock::now();
  if (client_->connected()) connected_ = now;
  if (std::chrono::duration<double>(now - connected_).count() < timeout_s_) return {};
  std::string reason = "the server went away while '" + options_.robot + "' was streaming";
  if (state.phase == SessionPhase::kSuspended && !state.status.ok()) reason += ": " + state.status.message;
  return Fail(StatusCode::kUnavailable, reason);
}

Result<void> RobotStream::Send(LogRecord&& record, std::size_t lidar) {
  if (auto there = CheckServer(); !there) return there;
  if (const auto* odometry = std::get_if<Odometry>(&record)) return client_->Publish(*odometry);
  const auto& scan = std::get<Scan>(record);
  ++sent_;
  if (options_.measure_latency) {
    const std::lock_guard lock(mutex_);
    DepartureOf(scan.stamp) = {scan.stamp, Clock::now(), true};
  }
  return client_->Publish(scan, options_.sensors[lidar]);
}

void RobotStream::Settle() {
  // Scans that are not settled in time appear as waiting or unexplained in the account. A server that cannot store says
  // so itself.
  if (client_->WaitSettled(timeout_s_)) (void)client_->WaitSafe(timeout_s_);
}

Result<void> RobotStream::End() {
  return client_->End(timeout_s_);
}

ScanAccount RobotStream::account() const {
  const std::lock_guard lock(mutex_);
  ScanAccount account = AccountOfSession(sent_);
  account.Add(closed_);
  return account;
}

int RobotStream::restarted() const {
  const std::lock_guard lock(mutex_);
  return restarted_;
}

Percentiles RobotStream::latency_ms() const {
  const std::lock_guard lock(mutex_);
  return latency_ms_;
}

}  // namespace cairn::client
