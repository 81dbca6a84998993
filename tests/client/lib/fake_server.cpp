#include "tests/client/lib/fake_server.h"

#include <algorithm>
#include <utility>

#include "tests/loopback.h"

namespace cairn::test {

FakeServer::FakeServer(const wire::WireOptions& options, Generation generation)
    : generation_(generation), bus_(MakeBus("fake server", options)) {
  sessions_ = Must(bus_->Advertise<SessionState>());
  refusals_ = Must(bus_->Advertise<SessionRefusal>());
  ledgers_ = Must(bus_->Advertise<Ledger>());
  poses_ = Must(bus_->Advertise<PoseReport>());
  maps_ = Must(bus_->Advertise<MapInfo>());
  tiles_ = Must(bus_->Advertise<TileSample>());
  replies_ = Must(bus_->Advertise<Reply>());
  const auto add = [this](auto subscription) { subscriptions_.push_back(Must(std::move(subscription))); };
  add(bus_->Subscribe<ScanSample>([this](ScanSample&& sample) { OnScan(std::move(sample)); }));
  add(bus_->Subscribe<OdometrySample>([this](OdometrySample&& sample) {
    const MutexLock lock(mutex_);
    ++odometry_received_;
    Account& account = accounts_[sample.stream.sensor_id];
    account.stream = sample.stream;
    account.seen.insert(sample.odometry.sequence);
    if (settling_) Report(sample.stream);
  }));
  add(bus_->Subscribe<Request>([this](Request&& request) { OnRequest(std::move(request)); }));
  add(bus_->Subscribe<Command>([this](Command&& command) { OnRequest(std::move(command.request)); }));
  add(bus_->Subscribe<SessionRequest>([this](SessionRequest&& request) { OnSession(std::move(request)); }));
}

FakeServer::~FakeServer() {
  subscriptions_.clear();
}

void FakeServer::SetLocalized(bool localized) {
  localized_ = localized;
}

void FakeServer::SetSettling(bool settling) {
  const MutexLock lock(mutex_);
  settling_ = settling;
  if (!settling) return;
  for (const auto& [sensor, account] : accounts_) Report(account.stream);
}

void FakeServer::SetDurable(bool durable) {
  const MutexLock lock(mutex_);
  durable_ = durable;
}

void FakeServer::SetDurableThrough(std::uint64_t sequence) {
  const MutexLock lock(mutex_);
  durable_through_ = sequence;
  for (const auto& [sensor, account] : accounts_) Report(account.stream);
}

void FakeServer::Restart(Generation generation) {
  std::vector<SessionRequest> sessions;
  {
    const MutexLock lock(mutex_);
    generation_ = generation;
    received_.clear();
    for (auto& [sensor, account] : accounts_) {
      account.seen.erase(account.seen.upper_bound(durable_through_), account.seen.end());
      account.settled = std::min(account.settled, durable_through_);
    }
    for (const auto& [robot, request] : owners_) sessions.push_back(request);
  }
  for (SessionRequest& request : sessions) OnSession(std::move(request));
}

void FakeServer::SayStale() {
  std::vector<SessionRequest> sessions;
  {
    const MutexLock lock(mutex_);
    stale_ = true;
    for (const auto& [robot, request] : owners_) sessions.push_back(request);
  }
  for (SessionRequest& request : sessions) OnSession(std::move(request));
}

void FakeServer::IgnorePings(int count) {
  const MutexLock lock(mutex_);
  ignored_pings_ = count;
}

std::vector<std::uint64_t> FakeServer::pings() const {
  const MutexLock lock(mutex_);
  return pings_;
}

void FakeServer::SetAnswering(bool answering) {
  const MutexLock lock(mutex_);
  answering_ = answering;
}

void FakeServer::LoseOnce(std::uint64_t sequence) {
  const MutexLock lock(mutex_);
  to_lose_.insert(sequence);
}

void FakeServer::Publish(const PoseReport& pose) {
  {
    const MutexLock lock(mutex_);
    published_poses_[pose.robot] = pose;
  }
  Must(poses_->Publish(pose));
}

void FakeServer::Publish(const MapInfo& info) {
  {
    const MutexLock lock(mutex_);
    published_maps_[info.site] = info;
  }
  Must(maps_->Publish(info));
}

void FakeServer::Publish(const TileSample& sample) {
  Must(tiles_->Publish(sample));
}

void FakeServer::SetGeneration(Generation generation) {
  const MutexLock lock(mutex_);
  generation_ = generation;
}

void FakeServer::IgnoreSessions(int count) {
  const MutexLock lock(mutex_);
  sessions_to_ignore_ = count;
}

void FakeServer::RefuseSessions(int count, const Status& why) {
  const MutexLock lock(mutex_);
  sessions_to_refuse_ = count;
  why_refused_ = why;
}

std::vector<SessionRequest> FakeServer::sessions() const {
  const MutexLock lock(mutex_);
  return asked_sessions_;
}

std::vector<std::uint64_t> FakeServer::received() const {
  const MutexLock lock(mutex_);
  return received_;
}

ScanSample FakeServer::last_scan() const {
  const MutexLock lock(mutex_);
  return last_scan_;
}

int FakeServer::odometry_received() const {
  const MutexLock lock(mutex_);
  return odometry_received_;
}

std::vector<RequestKind> FakeServer::asked() const {
  const MutexLock lock(mutex_);
  return asked_;
}

void FakeServer::OnSession(SessionRequest&& request) {
  SessionState state{.robot_id = HashName(request.robot),
                     .client = request.client,
                     .robot = request.robot,
                     .site = request.site,
                     .phase = SessionPhase::kActive,
                     .status = {},
                     .session = request.session};
  const MutexLock lock(mutex_);  // Also while publishing: otherwise an older state might follow a newer one.
  asked_sessions_.push_back(request);
  if (sessions_to_ignore_ > 0 && sessions_to_ignore_-- > 0) return;
  state.generation = generation_;
  state.durable = durable_;
  state.map_frame = kMapFrame;
  state.stale = stale_;
  const bool known = owners_.contains(request.robot);
  if (sessions_to_refuse_ > 0) {
    --sessions_to_refuse_;
    state.phase = SessionPhase::kRefused;
    state.status = why_refused_;
  } else if (!known && request.started) {
    state.phase = SessionPhase::kRefused;
    state.status = {StatusCode::kFailedPrecondition, "the server does not know this session"};
  } else if (known && owners_[request.robot].client != request.client) {
    state.phase = SessionPhase::kRefused;
    state.status = {StatusCode::kAlreadyExists, "robot '" + request.robot + "' is connected already"};
  } else {
    owners_[request.robot] = request;
    if (request.end) state.phase = SessionPhase::kEnded;
  }
  if (state.phase == SessionPhase::kRefused) {
    Must(refusals_->Publish({state}));
  } else {
    Must(sessions_->Publish(state));
  }
}

void FakeServer::OnScan(ScanSample&& sample) {
  const MutexLock lock(mutex_);
  if (to_lose_.erase(sample.scan.sequence) > 0) return;
  Account& account = accounts_[sample.stream.sensor_id];
  account.stream = sample.stream;
  if (!account.seen.insert(sample.scan.sequence).second) return;
  received_.push_back(sample.scan.sequence);
  last_scan_ = sample;
  if (!settling_) return;
  Report(sample.stream);
  PoseReport pose;
  pose.robot_id = sample.stream.robot_id;
  pose.stamp = sample.scan.stamp;
  pose.session = sample.stream.session;
  pose.scan_sequence = sample.scan.sequence;
  pose.generation = generation_;
  pose.localized = localized_;
  pose.reason = localized_ ? PoseReason::kTracking : PoseReason::kLost;
  Must(poses_->Publish(pose));
}

// Settles what is here without a gap: unlike the real server it waits for what is missing.
void FakeServer::Report(const StreamId& stream) {
  Account& account = accounts_[stream.sensor_id];
  while (account.seen.count(account.settled + 1) > 0) ++account.settled;
  Ledger ledger;
  ledger.robot_id = stream.robot_id;
  ledger.sensor_id = stream.sensor_id;
  ledger.received = ledger.used = account.seen.size();
  ledger.session = stream.session;
  ledger.generation = generation_;
  ledger.last_sequence = account.seen.empty() ? 0 : *account.seen.rbegin();
  ledger.settled_through = account.settled;
  ledger.durable_through = durable_through_;
  Must(ledgers_->Publish(ledger));
}

void FakeServer::OnRequest(Request&& request) {
  {
    const MutexLock lock(mutex_);
    asked_.push_back(request.kind);
    const bool is_ping = request.kind == RequestKind::kPing;
    if (!answering_ && !is_ping) return;
    if (is_ping) pings_.push_back(request.sequence);
    if (is_ping && ignored_pings_ > 0) {
      --ignored_pings_;
      return;
    }
  }
  Reply reply;
  reply.client = request.client;
  reply.sequence = request.sequence;
  switch (request.kind) {
    case RequestKind::kPing:
      reply.server_version = "fake";
      break;
    case RequestKind::kPose:
      reply.poses.resize(1);
      reply.poses[0].robot = request.robot;
      reply.poses[0].stamp = request.latest ? -1 : request.stamp;
      if (request.latest) {
        const MutexLock lock(mutex_);
        if (const auto last = published_poses_.find(request.robot); last != published_poses_.end())
          reply.poses[0] = last->second;
      }
      break;
    case RequestKind::kPath:
      reply.path.resize(request.smoothed ? 2 : 1);
      break;
    case RequestKind::kTiles:
      reply.map_epoch = 3;
      reply.map_version = 9;
      reply.tiles.resize(1);
      if (request.site == "drawn") {
        reply.tiles[0].key.level = static_cast<int>(request.level);
        reply.tiles[0].version = 1;
        reply.tiles[0].encoding = TileEncoding::kRaw;
        reply.tiles[0].bytes.assign(kTileArea, 100);
        break;
      }
      reply.tiles[0].bytes.resize(50000);
      reply.last = false;
      for (; reply.part + 1 < kTileParts; ++reply.part) {
        reply.tiles[0].key.x = static_cast<int>(reply.part);
        Must(replies_->Publish(reply));
      }
      reply.tiles[0].key.x = static_cast<int>(reply.part);
      reply.last = true;
      break;
    case RequestKind::kJobSubmit:
    case RequestKind::kJobGet:
    case RequestKind::kJobCancel:
      reply.jobs.resize(1);
      reply.jobs[0].id = request.kind == RequestKind::kJobSubmit ? 42 : request.job;
      reply.jobs[0].site = request.site;
      if (request.kind == RequestKind::kJobGet) {
        const MutexLock lock(mutex_);
        const bool ended = ++asked_for_job_[request.job] >= kAnswersUntilJobEnds;
        reply.jobs[0].state = ended ? JobState::kSucceeded : JobState::kRunning;
      }
      break;
    case RequestKind::kLandmarks:
      reply.landmarks.resize(2);
      break;
    case RequestKind::kMapInfo:
      if (request.site.empty() && !published_maps().empty()) {
        reply.maps = published_maps();
      } else {
        reply.maps.push_back(MapOf(request.site));
      }
      break;
    case RequestKind::kStatus:
      reply.robots.resize(3);
      break;
    case RequestKind::kJobList:
      reply.jobs.resize(2);
      break;
    case RequestKind::kRos2:
      reply.ros2 = {{.enabled = true, .domain = 5, .problems = {}}};
      reply.ros2_namespaces.resize(1);
      reply.ros2_namespaces[0].name = "/r1";
      reply.ros2_namespaces[0].problems = {"no odometry"};
      break;
    case RequestKind::kSavedList:
      reply.saved.resize(2);
      break;
    case RequestKind::kSiteSave:
      reply.saved.push_back({request.saved, request.site, 77, -1});
      break;
    case RequestKind::kSiteLoad:
      if (request.saved != "monday" || request.site != "hall")
        reply.status = {StatusCode::kNotFound, "no file " + request.saved};
      break;
    case RequestKind::kSiteDelete:
      if ((request.saved.empty() ? request.site != "hall" : request.saved != "monday"))
        reply.status = {StatusCode::kNotFound, "no site " + request.site + request.saved};
      break;
    case RequestKind::kSessionEnd:
      break;
    case RequestKind::kMapEdits:
      reply.edits.resize(2);
      for (MapEdit& edit : reply.edits) edit.points_map = {{0, 0}, {1, 0}, {request.site == "moon" ? 1e9 : 1, 1}};
      break;
    case RequestKind::kMapEditAdd:
      reply.edits = {request.edit};
      reply.edits[0].id = 5;
      break;
    case RequestKind::kMapEditRemove:
      if (request.edit.id != 5) reply.status = {StatusCode::kNotFound, "no edit"};
      break;
    case RequestKind::kLocalise:
    case RequestKind::kMap:
      if (request.robot != "robot1") reply.status = {StatusCode::kNotFound, "no robot " + request.robot};
      break;
    case RequestKind::kRelocalise:
      if (request.T_map_robot != Pose2{1.5, -2.0, kPi / 2})
        reply.status = {StatusCode::kFailedPrecondition, "another pose was expected"};
      break;
    case RequestKind::kMapEnable:
      if (request.map_version > kMapVersions) {
        reply.status = {StatusCode::kNotFound, "no version " + std::to_string(request.map_version)};
      } else {
        const MutexLock lock(mutex_);
        enabled_version_ = request.map_version;
      }
      break;
  }
  Must(replies_->Publish(reply));
}

std::vector<MapInfo> FakeServer::published_maps() const {
  const MutexLock lock(mutex_);
  std::vector<MapInfo> maps;
  for (const auto& [site, map] : published_maps_) maps.push_back(map);
  return maps;
}

MapInfo FakeServer::MapOf(const std::string& site) {
  const MutexLock lock(mutex_);
  if (const auto last = published_maps_.find(site); last != published_maps_.end()) return last->second;
  MapInfo info;
  info.site = site;
  info.resolution_m = 0.1;
  info.enabled_version = enabled_version_;
  for (std::uint32_t version = 1; version <= kMapVersions; ++version) {
    info.versions.push_back({version, version == enabled_version_, 0, ""});
  }
  return info;
}

}  // namespace cairn::test
