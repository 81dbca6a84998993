// What a checkpoint holds of a session's record, and what counts as stored with it (session_record.h).
#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include "server/robots/session_record.h"

namespace cairn::server {

// That it has ended, and why. Earlier formats have no checkpoints of sessions that have ended.
template <typename Archive>
void SessionRecord::EndMembers(Archive& archive, auto& state) {
  if constexpr (Archive::kReads)
    if (archive.format() < 10) return;
  bool ended = state.phase == SessionPhase::kEnded;
  archive(ended);
  if (!ended) return;
  archive(state.status.code, state.status.message);
  archive.Require(state.status.code >= StatusCode::kOk && state.status.code <= StatusCode::kDataLoss,
                  "why it has ended");
  if constexpr (Archive::kReads)
    if (archive.ok()) state.phase = SessionPhase::kEnded;
}

template <typename Archive>
void SessionRecord::Members(Archive& archive, auto& self, auto& odometry) {
  auto& pose = self.status_.pose;
  archive(self.status_.session.client, self.status_.session.session, pose.stamp, pose.session, pose.scan_sequence,
          pose.T_map_robot, pose.covariance, pose.T_map_odom, pose.localized, pose.score, pose.reason, pose.map_epoch);
  archive.Require(pose.reason <= PoseReason::kNotJoined, "the reason of a pose");
  archive(odometry, self.history_);
  EndMembers(archive, self.status_.session);
}

bool SessionRecord::Save(slam::StateWriter& writer, const WaitingScans& in_estimator) const {
  static const std::set<std::uint64_t> kNone;
  const MutexLock lock(mutex_);
  writer(static_cast<std::uint64_t>(streams_.size()));
  for (const auto& [sensor_id, stream] : streams_) {
    const auto taken = in_estimator.find(sensor_id);
    const auto account = stream.account.AsJournaled(taken == in_estimator.end() ? kNone : taken->second);
    if (!account) return false;
    writer(stream.account.ledger().sensor, *account);
  }
  const auto odometry = odometry_.account.AsJournaled(kNone);
  if (!odometry) return false;
  Members(writer, *this, *odometry);
  return true;
}

Result<void> SessionRecord::Load(slam::StateReader& reader, const WaitingScans& in_estimator) {
  const MutexLock lock(mutex_);
  std::uint64_t sensors = 0;
  reader(sensors);
  reader.Require(sensors <= kMaxSensors, "the number of sensors");
  for (std::uint64_t i = 0; i < sensors && reader.ok(); ++i) {
    std::string sensor;
    reader(sensor);
    const NameId sensor_id = HashName(sensor);
    Stream& stream = streams_[sensor_id];
    stream.account = StreamLedger(NamesOf(sensor_id, sensor));
    reader(stream.account);
  }
  if (reader.ok()) Members(reader, *this, odometry_.account);
  WaitingScans waiting;
  for (const auto& [sensor_id, stream] : streams_)
    if (!stream.account.waiting().empty()) waiting.emplace(sensor_id, stream.account.waiting());
  reader.Require(waiting == in_estimator && odometry_.account.waiting().empty(), "account of what waits");
  if (!reader.ok()) return Fail(StatusCode::kDataLoss, std::string("a checkpoint holds a wrong ") + reader.failed());
  return {};
}

void SessionRecord::BeginStoring(std::uint64_t position, const WaitingScans& in_estimator) {
  static const std::set<std::uint64_t> kNone;
  const MutexLock lock(mutex_);
  storing_ = true;
  stores_from_ = position;
  for (auto& [sensor_id, stream] : streams_) {
    const auto taken = in_estimator.find(sensor_id);
    stream.account.BeginStoring(taken == in_estimator.end() ? kNone : taken->second);
  }
  odometry_.account.BeginStoring(kNone);
}

bool SessionRecord::StoredAgain(std::uint64_t position) {
  const MutexLock lock(mutex_);
  if (!storing_ || position != stores_from_ || status_.session.durable) return false;
  status_.session.durable = true;
  if (status_.session.status.message == not_stored_.message) status_.session.status = {};
  const auto advance = [](Stream& stream) {
    stream.account.StoredAgain();
    stream.changed = true;
  };
  for (auto& [sensor_id, stream] : streams_) advance(stream);
  advance(odometry_);
  return true;
}

bool SessionRecord::begun() const {
  const MutexLock lock(mutex_);
  return status_.pose.reason != PoseReason::kWaiting;
}

void SessionRecord::Restored(std::uint64_t quiet_since_ms) {
  const MutexLock lock(mutex_);
  status_.session.durable = storing_ = true;
  status_.alive = false;
  if (status_.session.phase != SessionPhase::kEnded) {
    status_.session.phase = SessionPhase::kSuspended;
    status_.session.status = {StatusCode::kUnavailable, "the server was started again, and the robot is not back yet"};
    suspended_ = Clock::now();
  }
  // It has been away for as long as it was before the start, so that it ages also where servers start often.
  restored_ = Clock::now();
  const std::uint64_t now_ms = MillisecondsNow();
  quiet_since_ms_ = quiet_since_ms == 0 || quiet_since_ms > now_ms ? now_ms : quiet_since_ms;
  suspended_ = ended_ = Clock::now() - std::chrono::milliseconds(now_ms - quiet_since_ms_);
  const auto restore = [](Stream& stream) {
    stream.account.Restored();
    // What arrived before the start arrives again, or the stream stands still.
    if (stream.account.ledger().received > 0) stream.arrived = Clock::now();
    stream.resuming = stream.changed = true;
  };
  for (auto& [sensor_id, stream] : streams_) restore(stream);
  restore(odometry_);
}

}  // namespace cairn::server
