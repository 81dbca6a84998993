// The part of RobotClient that sends samples: new ones, and those that must be sent later or again.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "client/lib/deadline.h"
#include "client/lib/robot_client.h"

namespace cairn::client {

// Up to which number the samples of a stream are neither here any more nor waited for: they are safe, or there was no
// room for them. A server that was set back to an earlier state has settled less.
std::uint64_t RobotClient::GoneThrough(NameId sensor_id, const Stream& stream) const {
  const auto oldest = backlog_.OldestOf(sensor_id);
  return oldest ? *oldest - 1 : stream.window.sent();
}

Result<void> RobotClient::AwaitRoom(NameId sensor_id, const Stream& stream) {
  const auto deadline = DeadlineAfter(options_.send_timeout_s);
  for (;;) {
    if (over_) return tl::unexpected(*over_);
    if (state_->phase == SessionPhase::kEnded) {
      if (!state_->status.ok()) return tl::unexpected(state_->status);
      return Fail(StatusCode::kFailedPrecondition, fmt::format("the session of '{}' has ended", request_.robot));
    }
    if (stream.window.HasRoom(GoneThrough(sensor_id, stream))) return {};
    if (Clock::now() >= deadline) {
      return Fail(StatusCode::kUnavailable,
                  fmt::format("the server settled no scan of '{}' for {:.1f} s ({} sent, {} settled)", request_.robot,
                              options_.send_timeout_s, stream.window.sent(), stream.window.settled_through()));
    }
    changed_.WaitUntil(mutex_, deadline);
  }
}

Result<void> RobotClient::Publish(const Scan& scan) {
  std::string sensor;
  {
    const MutexLock lock(mutex_);
    sensor = request_.sensors.front();
  }
  return Publish(scan, sensor);
}

Result<void> RobotClient::Publish(const Scan& scan, const std::string& sensor) {
  const NameId sensor_id = HashName(sensor);
  for (;;) {
    Stream* stream = nullptr;
    {
      const MutexLock lock(mutex_);
      const auto found = streams_.find(sensor_id);
      if (found == streams_.end() || sensor == kOdometrySensor) {
        return Fail(StatusCode::kInvalidArgument, fmt::format("sensor '{}' is not part of the session", sensor));
      }
      stream = &found->second;
      if (auto room = AwaitRoom(sensor_id, *stream); !room) return room;
    }
    const MutexLock sending(sending_);
    {
      const MutexLock lock(mutex_);
      if (!stream->window.HasRoom(GoneThrough(sensor_id, *stream))) continue;  // Another thread was faster.
    }
    return AddAndSend(ScanSample{{robot_id_, sensor_id, 0}, scan}, *stream);
  }
}

Result<void> RobotClient::Publish(const Odometry& odometry) {
  const NameId sensor_id = HashName(kOdometrySensor);
  const MutexLock sending(sending_);
  Stream* stream = nullptr;
  {
    const MutexLock lock(mutex_);
    if (over_) return tl::unexpected(*over_);
    stream = &streams_.find(sensor_id)->second;
    if (!start_odometry_) start_odometry_ = odometry;
    WatchOdometry(odometry);
  }
  return AddAndSend(OdometrySample{{robot_id_, sensor_id, 0}, odometry}, *stream);
}

bool RobotClient::Settled() const {
  return std::ranges::all_of(streams_, [](const auto& entry) { return entry.second.window.settled(); });
}

// Numbers and keeps the sample, and sends it at once if no other sample waits before it.
Result<void> RobotClient::AddAndSend(StreamedSample&& sample, Stream& stream) {
  std::shared_ptr<const StreamedSample> next;
  {
    const MutexLock lock(mutex_);
    if (Settled()) progress_ = Clock::now();
    const SessionToken session = request_.session;
    std::visit([session](auto& one) { one.stream.session = session; }, sample);
    if (auto* const scan = std::get_if<ScanSample>(&sample)) {
      scan->scan.sequence = stream.window.Next();
    } else {
      std::get<OdometrySample>(sample).odometry.sequence = stream.window.Next();
    }
    const bool behind = backlog_.unsent() > 0 || !Streaming();
    backlog_.Add(std::move(sample));
    changed_.NotifyAll();  // Watch sends the samples that wait.
    if (behind) return {};
    next = backlog_.Next();
  }
  Result<void> sent = SendNow(*next);
  if (sent) return {};
  const MutexLock lock(mutex_);
  if (sent.error().code == StatusCode::kUnavailable) {
    backlog_.StepBack();  // The writer was busy; Watch sends the sample again.
    return {};
  }
  backlog_.TakeBack();  // It can never be sent: the caller's error.
  stream.window.TakeBack();
  return sent;
}

Result<void> RobotClient::SendNow(const StreamedSample& sample) {
  bool first = false;
  std::shared_ptr<Wire> wire;
  {
    const MutexLock lock(mutex_);
    first = !std::exchange(request_.started, true);
    wire = wire_;
  }
  // Published before the first sample, so that a server that starts later does not open the session at its old start.
  if (first) Ask();
  const auto* const scan = std::get_if<ScanSample>(&sample);
  const auto* const odometry = std::get_if<OdometrySample>(&sample);
  Result<void> published = scan != nullptr ? wire->scans->Publish(*scan) : wire->odometry->Publish(*odometry);
  if (!published) return published;
  const MutexLock lock(mutex_);
  if (scan != nullptr) {
    Sent(scan->stream.sensor_id, scan->scan.sequence);
  } else {
    Sent(odometry->stream.sensor_id, odometry->odometry.sequence);
  }
  return {};
}

// Sends the samples from the backlog's cursor on, as fast as the server settles them.
void RobotClient::Pump() {
  const MutexLock sending(sending_);
  for (;;) {
    std::shared_ptr<const StreamedSample> sample;
    bool again = false;
    {
      const MutexLock lock(mutex_);
      if (stopping_ || !Streaming()) return;
      if (const auto scan = backlog_.next_scan()) {
        const Stream& stream = streams_.find(scan->first)->second;
        const std::uint64_t done = std::max(stream.window.settled_through(), GoneThrough(scan->first, stream));
        // Watch continues with the next ledger.
        if (scan->second > done + std::max(pace_, kFirstPace)) return;
      }
      sample = backlog_.Next();
      if (sample == nullptr) return;
      again = sent_before_ > 0;
      if (again) --sent_before_;
    }
    // Counted first: the server may settle the sample before it returns.
    again = again && std::holds_alternative<ScanSample>(*sample);
    if (again) resent_.fetch_add(1, std::memory_order_relaxed);
    if (SendNow(*sample)) continue;
    if (again) resent_.fetch_sub(1, std::memory_order_relaxed);
    const MutexLock lock(mutex_);
    backlog_.StepBack();
    return;
  }
}

}  // namespace cairn::client
