#include "server/robots/session_record.h"

#include <algorithm>
#include <utility>

#include "common/geometry/rotated_covariance.h"
#include "common/wall_clock.h"
#include "server/inbound.h"

namespace cairn::server {

SessionRecord::SessionRecord(SessionId id, const SessionRequest& request, const RobotsOptions& options)
    : id_(id),
      ledger_period_(
          std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / options.ledger_rate_hz))),
      gap_wait_(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.gap_wait_s))),
      history_(static_cast<std::size_t>(options.max_path_poses)),
      landmarks_(std::make_shared<const std::vector<LandmarkReport>>()) {
  const MutexLock lock(mutex_);
  const NameId robot_id = HashName(request.robot);
  status_.session = {.robot_id = robot_id,
                     .client = request.client,
                     .robot = request.robot,
                     .site = request.site,
                     .phase = SessionPhase::kActive,
                     .status = {},
                     .session = request.session};
  status_.alive = true;
  status_.pose.robot_id = robot_id;
  status_.pose.robot = request.robot;
  status_.pose.site = request.site;
  if (request.has_start) status_.pose.T_map_robot = request.T_map_robot_start;
  odometry_.account.Rename(NamesOf(HashName(kOdometry), kOdometry));
}

Ledger SessionRecord::NamesOf(NameId sensor_id, const std::string& sensor) const {
  Ledger names;
  names.robot_id = status_.session.robot_id;
  names.sensor_id = sensor_id;
  names.robot = status_.session.robot;
  names.sensor = sensor;
  names.site = status_.session.site;
  return names;
}

bool SessionRecord::AddSensors(const std::vector<std::string>& sensors) {
  const MutexLock lock(mutex_);
  std::map<NameId, Stream> added;
  for (const std::string& sensor : sensors) {
    const NameId sensor_id = HashName(sensor);
    if (!streams_.contains(sensor_id)) added.emplace(sensor_id, Stream{StreamLedger(NamesOf(sensor_id, sensor))});
  }
  if (streams_.size() + added.size() > kMaxSensors) return false;
  for (auto& [sensor_id, stream] : added) stream.account.SetStored(storing_);
  streams_.merge(added);
  return true;
}

void SessionRecord::Inherit(NameId sensor_id, StreamLedger&& account) {
  const MutexLock lock(mutex_);
  Stream* const stream = Find(sensor_id);
  if (stream == nullptr) return;
  account.Rename(stream->account.ledger());
  account.SetStored(storing_);
  stream->account = std::move(account);
}

SessionRecord::Stream* SessionRecord::Find(NameId sensor_id) {
  const auto found = streams_.find(sensor_id);
  return found == streams_.end() ? nullptr : &found->second;
}

bool SessionRecord::Has(NameId sensor_id) const {
  const MutexLock lock(mutex_);
  return streams_.contains(sensor_id);
}

std::uint64_t SessionRecord::NumberOf(SessionToken session, std::uint64_t sequence) const {
  return session == status_.session.session && sequence <= kMaxSequence ? sequence : 0;
}

SessionRecord::Arrival SessionRecord::Account(Stream& stream, std::uint64_t sequence, std::uint64_t number, From from) {
  stream.arrived = Clock::now();
  if (LeftAside(stream, sequence)) return Arrival::kAside;
  if (from == From::kRobot && stream.account.IsDoubtful(number)) return Arrival::kAside;
  if (!stream.account.Received(number)) return Arrival::kDuplicate;
  stream.changed = true;
  return Arrival::kNew;
}

SessionRecord::Arrival SessionRecord::ScanReceived(const StreamId& of, std::uint64_t sequence, From from) {
  const MutexLock lock(mutex_);
  Stream* const stream = Find(of.sensor_id);
  if (stream == nullptr) return Arrival::kUnknownSensor;
  return Account(*stream, sequence, NumberOf(of.session, sequence), from);
}

void SessionRecord::ScanDropped(const StreamId& of, std::uint64_t sequence, DropReason reason) {
  const MutexLock lock(mutex_);
  if (Stream* const stream = Find(of.sensor_id)) {
    stream->account.Dropped(NumberOf(of.session, sequence), reason);
    stream->changed = true;
  }
}

void SessionRecord::ScanUsed(const StreamId& of, const PoseReport& pose, Stamp path_stamp, bool keyframe,
                             double latency_ms) {
  const MutexLock lock(mutex_);
  status_.pose = pose;
  history_.Append({path_stamp, pose.T_map_robot, static_cast<float>(pose.score), pose.localized, pose.reason,
                   pose.covariance.cast<float>(), pose.T_map_odom});
  if (Stream* const stream = Find(of.sensor_id)) {
    stream->account.Used(NumberOf(of.session, pose.scan_sequence), pose.stamp, keyframe, latency_ms);
    stream->changed = true;
  }
}

SessionRecord::Arrival SessionRecord::ForeignScan(NameId sensor_id, DropReason reason) {
  const MutexLock lock(mutex_);
  Stream* const stream = Find(sensor_id);
  if (stream == nullptr) return Arrival::kUnknownSensor;
  stream->account.DroppedForeign(reason);
  stream->changed = true;
  return Arrival::kNew;
}

bool SessionRecord::OdometryReceived(SessionToken session, std::uint64_t sequence, From from) {
  const MutexLock lock(mutex_);
  return Account(odometry_, sequence, NumberOf(session, sequence), from) == Arrival::kNew;
}

void SessionRecord::OdometryUsed(SessionToken session, std::uint64_t sequence, Stamp stamp) {
  const MutexLock lock(mutex_);
  odometry_.account.Used(NumberOf(session, sequence), stamp);
  odometry_.changed = true;
}

void SessionRecord::OdometryDropped(SessionToken session, std::uint64_t sequence, DropReason reason) {
  const MutexLock lock(mutex_);
  odometry_.account.Dropped(NumberOf(session, sequence), reason);
  odometry_.changed = true;
}

bool SessionRecord::LeftAside(Stream& stream, std::uint64_t sequence) const {
  if (!stream.resuming) return false;
  if (!stream.account.NextIs(sequence)) {
    const auto now = Clock::now();
    if (stream.aside == Clock::time_point{}) stream.aside = now;
    if (now - stream.aside < gap_wait_) return true;
    stream.resuming = false;
  } else if (!stream.account.NextIs(sequence + 1)) {  // `sequence` is expected and no duplicate.
    stream.resuming = false;
  }
  return false;
}

bool SessionRecord::SetStored(bool stored, const Status& why) {
  const MutexLock lock(mutex_);
  storing_ = stored;
  for (auto& [sensor_id, stream] : streams_) stream.account.SetStored(stored);
  odometry_.account.SetStored(stored);
  if (status_.session.durable == stored) return false;
  status_.session.durable = stored;
  if (!stored && status_.session.status.ok()) status_.session.status = not_stored_ = why;
  return true;
}

std::vector<std::string> SessionRecord::sensors() const {
  const MutexLock lock(mutex_);
  std::vector<std::string> names;
  for (const auto& [sensor_id, stream] : streams_) names.push_back(stream.account.ledger().sensor);
  return names;
}

void SessionRecord::SetLandmarks(std::vector<LandmarkReport> landmarks) {
  auto shared = std::make_shared<const std::vector<LandmarkReport>>(std::move(landmarks));
  const MutexLock lock(mutex_);
  landmarks_.swap(shared);
}

void SessionRecord::SetLearned(std::vector<LearnedValue> learned) {
  const MutexLock lock(mutex_);
  status_.learned = std::move(learned);
}

void SessionRecord::SetHypotheses(std::vector<PoseHypothesis> hypotheses) {
  const MutexLock lock(mutex_);
  hypotheses_ = std::move(hypotheses);
}

void SessionRecord::SetJoining(const Joining& joining) {
  const MutexLock lock(mutex_);
  joining_ = joining;
}

void SessionRecord::SetLocalises(bool localises) {
  const MutexLock lock(mutex_);
  localises_ = localises;
}

bool SessionRecord::localises() const {
  const MutexLock lock(mutex_);
  return localises_;
}

SessionRecord::Joining SessionRecord::joining() const {
  const MutexLock lock(mutex_);
  return joining_;
}

void SessionRecord::SetEpoch(std::uint32_t epoch) {
  const MutexLock lock(mutex_);
  status_.pose.map_epoch = epoch;
}

void SessionRecord::MoveLast(const Pose2& T_new_old) {
  const MutexLock lock(mutex_);
  hypotheses_.clear();
  PoseReport& pose = status_.pose;
  pose.T_map_robot = T_new_old * pose.T_map_robot;
  pose.T_map_odom = T_new_old * pose.T_map_odom;
  pose.covariance = Rotated(pose.covariance, T_new_old.theta);
}

void SessionRecord::MovePath(std::span<const StampedPose> now, bool moves_rest, std::optional<bool> fragment) {
  const MutexLock lock(mutex_);
  history_.MoveOnto(now, moves_rest, fragment);
}

void SessionRecord::ForgetPath() {
  const MutexLock lock(mutex_);
  history_.Clear();
}

void SessionRecord::LoseLast() {
  const MutexLock lock(mutex_);
  hypotheses_.clear();
  if (!status_.pose.localized) return;
  status_.pose.localized = false;
  status_.pose.reason = PoseReason::kLost;
}

void SessionRecord::SetMapFrame(std::uint64_t map_frame) {
  const MutexLock lock(mutex_);
  status_.session.map_frame = map_frame;
}

void SessionRecord::SetAlive(bool alive) {
  const MutexLock lock(mutex_);
  status_.alive = alive;
}

bool SessionRecord::SetPhase(SessionPhase phase, Status status) {
  const MutexLock lock(mutex_);
  if (status_.session.phase == SessionPhase::kEnded) return false;
  if (phase == SessionPhase::kActive && status_.session.phase != phase) active_ = Clock::now();
  if (phase == SessionPhase::kSuspended && status_.session.phase != phase) suspended_ = Clock::now();
  if (phase == SessionPhase::kEnded) ended_ = Clock::now();
  if (status_.session.phase != phase) quiet_since_ms_ = phase == SessionPhase::kActive ? 0 : MillisecondsNow();
  status_.session.phase = phase;
  status_.session.status = std::move(status);
  return true;
}

bool SessionRecord::LookForSilence(Clock::time_point now) {
  constexpr std::chrono::milliseconds kPatience{1800};  // With the period of the housekeeping below 2 s.
  const MutexLock lock(mutex_);
  std::string silence;
  const auto look = [&](const Stream& stream) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    // The robot may not have begun to send a stream of which nothing has arrived.
    if (stream.arrived == Clock::time_point{} || now - std::max(stream.arrived, active_) <= kPatience) return;
    silence += (silence.empty() ? "'" : ", '") + stream.account.ledger().sensor + "'";
  };
  if (status_.session.phase == SessionPhase::kActive && status_.alive) {
    for (const auto& [sensor_id, stream] : streams_) look(stream);
    look(odometry_);
  }
  return std::exchange(silence_, silence) != silence;
}

bool SessionRecord::Resume(ClientId client, SessionToken session) {
  const MutexLock lock(mutex_);
  if (status_.session.phase == SessionPhase::kEnded) return false;
  if (status_.session.session != session) {
    for (auto& [sensor_id, stream] : streams_) stream.account.NewClient();
    odometry_.account.NewClient();
    for (auto& [sensor_id, stream] : streams_) stream.resuming = false;
    odometry_.resuming = false;
  }
  if (status_.session.phase != SessionPhase::kActive) active_ = Clock::now();
  status_.session.client = client;
  status_.session.session = session;
  status_.session.phase = SessionPhase::kActive;
  quiet_since_ms_ = 0;
  status_.session.status = {};
  status_.alive = true;
  return true;
}

ClientId SessionRecord::owner() const {
  const MutexLock lock(mutex_);
  return status_.session.client;
}

SessionToken SessionRecord::token() const {
  const MutexLock lock(mutex_);
  return status_.session.session;
}

bool SessionRecord::alive() const {
  const MutexLock lock(mutex_);
  return status_.alive;
}

SessionPhase SessionRecord::phase() const {
  const MutexLock lock(mutex_);
  return status_.session.phase;
}

SessionState SessionRecord::state() const {
  const MutexLock lock(mutex_);
  return StateNow();
}

SessionState SessionRecord::StateNow() const {
  SessionState state = status_.session;
  if (joining_.fragment && !joining_.why.empty() && state.status.ok())
    state.status = {StatusCode::kFailedPrecondition, joining_.why};
  if (localises_ && state.status.ok() && state.status.message.empty())
    state.status.message = "only localised: nothing is drawn of it";
  state.localise_only = localises_;
  state.fragment = joining_.fragment;
  state.stale = !silence_.empty();
  if (state.stale && state.status.ok()) {
    state.status = {StatusCode::kUnavailable,
                    "stale: nothing arrives of " + silence_ + ", although the robot's client is alive"};
  }
  return state;
}

SessionRecord::Clock::duration SessionRecord::SuspendedFor(Clock::time_point now) const {
  const MutexLock lock(mutex_);
  return status_.session.phase == SessionPhase::kSuspended ? now - suspended_ : Clock::duration::zero();
}

SessionRecord::Clock::duration SessionRecord::AwayFor(Clock::time_point now) const {
  const MutexLock lock(mutex_);
  if (status_.session.phase != SessionPhase::kSuspended) return Clock::duration::zero();
  return restored_ ? std::min(now - suspended_, now - *restored_) : now - suspended_;
}

bool SessionRecord::HasHadTime(Clock::time_point now) const {
  const MutexLock lock(mutex_);
  return !restored_ || now - *restored_ >= std::chrono::hours(1);
}

std::uint64_t SessionRecord::MillisecondsNow() {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(0, WallClock() / kNanosPerMillisecond));
}

std::uint64_t SessionRecord::quiet_since_ms() const {
  const MutexLock lock(mutex_);
  return quiet_since_ms_;
}

SessionRecord::Clock::duration SessionRecord::EndedFor(Clock::time_point now) const {
  const MutexLock lock(mutex_);
  return status_.session.phase == SessionPhase::kEnded ? now - ended_ : Clock::duration::zero();
}

std::uint32_t SessionRecord::epoch() const {
  const MutexLock lock(mutex_);
  return status_.pose.map_epoch;
}

SessionSnapshot SessionRecord::snapshot() const {
  const MutexLock lock(mutex_);
  SessionSnapshot snapshot{
      .id = id_, .status = status_, .path = history_.view(), .landmarks = landmarks_, .hypotheses = hypotheses_};
  snapshot.status.session = StateNow();
  for (const auto& [sensor_id, stream] : streams_) snapshot.status.ledgers.push_back(LedgerOf(stream));
  return snapshot;
}

}  // namespace cairn::server
