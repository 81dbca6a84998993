#include "server/robots/roster.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <optional>
#include <utility>

#include "common/service/start_pose.h"
#include "server/ops/log_context.h"
#include "server/store/crash_note.h"

namespace cairn::server {
namespace {

constexpr std::size_t kMaxUnsent = 256;  // Refusals kept until they can be sent; beyond, the oldest is forgotten.

Result<void> ValidateRequest(const SessionRequest& request) {
  if (auto valid = ValidateName("robot", request.robot); !valid) return valid;
  if (auto valid = ValidateName("site", request.site); !valid) return valid;
  if (request.session == 0) return Fail(StatusCode::kInvalidArgument, "the session must not be 0");
  if (request.client == 0) return Fail(StatusCode::kInvalidArgument, "the client id must not be 0");
  if (request.sensors.empty()) return Fail(StatusCode::kInvalidArgument, "no sensor is named");
  if (request.sensors.size() > SessionRecord::kMaxSensors) {
    return Fail(StatusCode::kInvalidArgument, std::to_string(request.sensors.size()) + " sensors; at most 16");
  }
  for (const std::string& sensor : request.sensors) {
    if (auto valid = ValidateName("sensor", sensor); !valid) return valid;
    if (sensor == SessionRecord::kOdometry)
      return Fail(StatusCode::kInvalidArgument,
                  "no sensor may be named 'odometry': this is the name of the robot's odometry stream");
  }
  return request.has_start ? ValidateStart(request.T_map_robot_start) : Result<void>{};
}

bool HasDrawn(const Session& session) {
  return session.record().begun();
}

}  // namespace

Roster::Roster(const RobotsOptions& options, const slam::MapperOptions& mapper, asio::thread_pool& pool,
               Outbound& outbound, Atlas& atlas, Journal* journal)
    : options_(options),
      mapper_(mapper),
      pool_(pool),
      outbound_(outbound),
      atlas_(atlas),
      journal_(journal),
      unclaimed_(static_cast<std::size_t>(options.max_unclaimed)) {}

Roster::~Roster() {
  *closing_ = true;
}

void Roster::Take(const SessionRequest& request) {
  {
    // A refusal that could not be sent yet is outdated by the answer to this request.
    const MutexLock lock(mutex_);
    std::erase_if(unsent_, [&request](const SessionRefusal& refusal) {
      return refusal.state.client == request.client && refusal.state.robot == request.robot;
    });
  }
  if (request.end) {
    const std::shared_ptr<Session> session = Find(request.robot);
    if (session == nullptr) {
      Refuse(request, {StatusCode::kNotFound, "robot '" + request.robot + "' has no session"});
    } else if (session->record().owner() != request.client) {
      Refuse(request, {StatusCode::kPermissionDenied, "another client owns the session of '" + request.robot + "'"});
    } else {
      session->End();
    }
    return;
  }
  std::optional<LogContext> context;  // Also of what is logged about an exception.
  try {
    context.emplace(AboutRobot(request.robot, request.site));
    if (auto admitted = Admit(request); !admitted) Refuse(request, admitted.error());
  } catch (const std::exception& error) {
    spdlog::error("a session of robot {} could not be opened because of an exception: {}", request.robot, error.what());
    // The client asks again: memory, for example, may be short only now.
    Refuse(request, {StatusCode::kUnavailable, "internal error of the server; see its log for the cause"});
  }
}

Result<void> Roster::Admit(const SessionRequest& request) {
  if (auto valid = ValidateRequest(request); !valid) return valid;
  std::shared_ptr<Session> session;
  {
    const MutexLock lock(mutex_);
    const auto found = sessions_.find(HashName(request.robot));
    if (found != sessions_.end()) session = found->second;
  }
  if (session != nullptr && session->record().token() == request.session) {
    if (session->record().phase() != SessionPhase::kEnded) return Resume(*session, request);
    session->End();  // Announces again that it has ended.
    return {};
  }
  if (request.started) return tl::unexpected(WhyNotKnown(request.robot));
  if (session == nullptr || session->record().phase() == SessionPhase::kEnded) return Open(request);
  // Before the first scan of a session was used, the robot may have been carried away from where the old client said.
  const bool replaces = request.has_start || !HasDrawn(*session);
  return replaces ? Replace(*session, request) : Resume(*session, request);
}

// A client opens a new session by itself, and sends again what no server has stored, unless that is the reason.
Status Roster::WhyNotKnown(const std::string& robot) const {
  const std::string what = "the server does not know this session of '" + robot + "'";
  const MutexLock lock(mutex_);
  const auto found = not_restored_.find(robot);
  if (found == not_restored_.end()) return {StatusCode::kFailedPrecondition, what + "; open a new one"};
  const Status& why = found->second;
  if (why.code == StatusCode::kInvalidArgument) return {why.code, what + " any more (" + why.message + ")"};
  return {StatusCode::kFailedPrecondition, what + "; open a new one (" + why.message + ")"};
}

// Whether the request may take over this session, or else why not. REQUIRES: the session has not ended.
Result<void> Roster::MayTakeOver(const Session& session, const SessionRequest& request) {
  const SessionState state = session.record().state();
  if (session.ending())
    return Fail(StatusCode::kUnavailable, "the last session of '" + request.robot + "' is still ending; try again");
  if (state.robot != request.robot) {
    return Fail(StatusCode::kAlreadyExists,
                "the names '" + request.robot + "' and '" + state.robot + "' share an id; choose another name");
  }
  if (state.client != request.client && session.record().alive())
    return Fail(StatusCode::kAlreadyExists, "another live client streams as '" + request.robot + "'");
  if (state.site != request.site) {
    return Fail(StatusCode::kFailedPrecondition, "'" + request.robot + "' has an open session in site '" + state.site +
                                                     "'; end it first (`cairn session end " + request.robot + "`)");
  }
  return {};
}

// The new client gets a new session instead of the old one.
Result<void> Roster::Replace(Session& session, const SessionRequest& request) {
  if (auto may = MayTakeOver(session, request); !may) return may;
  const SessionState state = session.record().state();
  if (auto opened = Open(request); !opened) return opened;
  session.End({StatusCode::kAborted, "another client has opened a new session of '" + state.robot + "'"});
  TellDisplaced(state, request);
  return {};
}

void Roster::TellDisplaced(const SessionState& before, const SessionRequest& request) {
  if (before.client == request.client) return;
  SessionRequest displaced = request;
  displaced.client = before.client;
  displaced.session = before.session;
  Refuse(displaced, {StatusCode::kAlreadyExists, "another client has taken over the session of '" + before.robot +
                                                     "' while this one was not alive"});
}

Result<void> Roster::Resume(Session& session, const SessionRequest& request) {
  if (auto may = MayTakeOver(session, request); !may) return may;
  const SessionState state = session.record().state();
  if (!session.record().AddSensors(request.sensors)) {
    return Fail(StatusCode::kResourceExhausted, "more than 16 sensors in one session");
  }
  if (!session.Resume(request.client, request.session))
    return Fail(StatusCode::kUnavailable, "the last session of '" + request.robot + "' is still ending; try again");
  TellDisplaced(state, request);
  return {};
}

void Roster::Refuse(const SessionRequest& request, Status status) {
  const NameId robot_id = HashName(request.robot);
  {
    const MutexLock lock(mutex_);
    if (unsent_.size() >= kMaxUnsent) unsent_.pop_front();
    unsent_.push_back({{.robot_id = robot_id,
                        .client = request.client,
                        .robot = request.robot,
                        .site = request.site,
                        .phase = SessionPhase::kRefused,
                        .status = std::move(status),
                        .session = request.session}});
  }
  SendRefusals();
}

void Roster::SendRefusals() {
  const MutexLock lock(mutex_);
  while (!unsent_.empty() && outbound_.Send(unsent_.front())) unsent_.pop_front();
}

void Roster::Take(ScanArrival&& arrival) {
  const StreamId stream = arrival.stream;
  const std::uint64_t sequence = arrival.scan->sequence;
  std::shared_ptr<Session> session;
  {
    const MutexLock lock(mutex_);
    const auto found = sessions_.find(stream.robot_id);
    if (found != sessions_.end()) session = found->second;
  }
  const DropReason reason = session != nullptr && session->record().token() != stream.session ? DropReason::kNotOwner
                                                                                              : DropReason::kNoSession;
  if (session != nullptr && session->Take(std::move(arrival))) return;
  const MutexLock lock(mutex_);
  unclaimed_.Count(stream, sequence, reason, UnclaimedStreams::Clock::now());
}

void Roster::Take(OdometryArrival&& arrival) {
  std::shared_ptr<Session> session;
  {
    const MutexLock lock(mutex_);
    const auto found = sessions_.find(arrival.stream.robot_id);
    if (found != sessions_.end()) session = found->second;
  }
  if (session != nullptr) session->Take(std::move(arrival));
}

void Roster::Take(const ClientLiveliness& liveliness) {
  std::shared_ptr<Session> session;
  {
    const MutexLock lock(mutex_);
    const auto found = sessions_.find(liveliness.robot_id);
    if (found != sessions_.end()) session = found->second;
  }
  if (session != nullptr && session->record().owner() == liveliness.client) session->SetLiveliness(liveliness.alive);
}

Result<void> Roster::End(const std::string& robot, std::shared_ptr<Receipt> receipt) {
  const auto session = FindOrFail(robot);
  if (!session) return tl::unexpected(session.error());
  (*session)->End({}, std::move(receipt));
  return {};
}

Result<void> Roster::Relocalise(const std::string& robot, std::optional<Pose2> T_map_robot,
                                const std::shared_ptr<Receipt>& receipt) {
  if (T_map_robot) {
    if (auto valid = ValidateStart(*T_map_robot); !valid) return valid;
    T_map_robot->theta = WrapAngle(T_map_robot->theta);
  }
  const auto session = FindOrFail(robot);
  if (!session) return tl::unexpected(session.error());
  return (*session)->Relocalise(T_map_robot, receipt);
}

Result<void> Roster::Localise(const std::string& robot, bool only, const std::shared_ptr<Receipt>& receipt) {
  const auto session = FindOrFail(robot);
  if (!session) return tl::unexpected(session.error());
  if (!only) return (*session)->MapAgain(receipt);
  const auto site = atlas_.Find((*session)->record().state().site);
  const auto map = site != nullptr ? site->snapshot() : nullptr;
  if (map == nullptr || !map->drawn) return Fail(StatusCode::kNotFound, "nothing is drawn in the map of its site");
  return (*session)->Localise(map, receipt);
}

Result<std::shared_ptr<Session>> Roster::FindOrFail(const std::string& robot) const {
  std::shared_ptr<Session> session = Find(robot);
  if (session == nullptr) return Fail(StatusCode::kNotFound, "robot '" + robot + "' has no session");
  return session;
}

void Roster::Tick() {
  const std::chrono::duration<double> expiry(options_.suspended_expiry_s);
  const auto now = SessionRecord::Clock::now();
  for (const auto& session : All()) {
    session->Tick();
    if (session->record().localises()) {
      if (const auto site = atlas_.Find(session->record().state().site)) session->KeepUpWith(site->snapshot());
    }
    if (session->record().SuspendedFor(now) > expiry && session->record().HasHadTime(now))
      session->End({StatusCode::kDeadlineExceeded, "its robot stayed away for longer than robots.suspended_expiry_s"});
    if (session->record().EndedFor(now) > expiry) MakeEarlier(session);
  }
  SendRefusals();
  RetireGone();
  ForgetSpareSessions();
  const MutexLock lock(mutex_);
  for (const auto& [id, session] : earlier_) session->TickEnded(now);
  StoreQuiet();
  for (Ledger& ledger : unclaimed_.TakeChanged()) outbound_.Send(std::move(ledger));
  unclaimed_.ForgetSilent(UnclaimedStreams::Clock::now(), [this](const Ledger& ledger) CAIRN_REQUIRES(mutex_) {
    const auto session = sessions_.find(ledger.robot_id);
    const bool used = session != sessions_.end() && session->second->record().Has(ledger.sensor_id);
    return used || outbound_.Send(Retired{ledger});
  });
}

// Since when sessions are quiet is stored where it has changed. With the lock: a session that is removed meanwhile must
// not be stored once more.
void Roster::StoreQuiet() {
  if (journal_ == nullptr) return;
  for (const auto& [robot_id, session] : sessions_) {
    if (!session->record().state().durable) continue;
    if (auto changed = session->TakeChangedStored()) {
      journal_->Put({RecordKind::kSession, session->id(), 0},
                    [stored = std::move(*changed)] { return BytesOf(stored); });
    }
  }
}

// An ended session whose robot has not come back is one of the earlier ones, of which only so many are kept.
void Roster::MakeEarlier(const std::shared_ptr<Session>& ended) {
  const MutexLock lock(mutex_);
  const auto place = sessions_.find(ended->record().state().robot_id);
  if (place == sessions_.end() || place->second != ended) return;
  gone_.push_back({ended, true});
  sessions_.erase(place);
}

// Once a removed session has published its last state, its keys on the wire that no other session uses are retired.
void Roster::RetireGone() {
  std::vector<std::shared_ptr<Session>> freed;  // Destroyed after the lock is released.
  const MutexLock lock(mutex_);
  std::erase_if(gone_, [&](const Leaving& leaving) CAIRN_REQUIRES(mutex_) {
    const std::shared_ptr<Session>& gone = leaving.session;
    const auto successor = sessions_.find(gone->record().state().robot_id);
    if (successor == sessions_.end() && !gone->ending() && gone->record().phase() != SessionPhase::kEnded)
      gone->End({StatusCode::kResourceExhausted, "its robot stayed away, and its place was needed for another"});
    const bool works = gone->has_work();  // Before the Tick, which may schedule a checkpoint.
    if (successor == sessions_.end()) {
      gone->Tick();
    } else {
      gone->TickEnded(SessionRecord::Clock::now());
    }
    if (gone->record().phase() != SessionPhase::kEnded || works || gone->end_untold()) return false;
    const RobotStatus status = gone->record().snapshot().status;
    bool retired = true;
    const auto retire = [&](auto&& of) { retired = retired && outbound_.Send(Retired{std::move(of)}); };
    for (const Ledger& ledger : status.ledgers) {
      if (successor == sessions_.end() || !successor->second->record().Has(ledger.sensor_id)) retire(Ledger(ledger));
    }
    if (successor != sessions_.end()) {
      successor->second->Announce();  // The end of the removed session may have been published after its state.
    } else {
      Ledger odometry;
      odometry.robot_id = status.session.robot_id;
      odometry.sensor_id = HashName(SessionRecord::kOdometry);
      retire(std::move(odometry));
      retire(PoseReport(status.pose));
      retire(SessionState(status.session));
    }
    if (!retired) return false;
    if (leaving.keep && HasDrawn(*gone)) {
      gone->record().ForgetPath();  // Nobody can ask for it any more, and a pose takes 104 bytes.
      earlier_.emplace(gone->id(), gone);
    } else {
      freed.push_back(gone);
    }
    return true;
  });
  while (earlier_.size() > static_cast<std::size_t>(options_.max_earlier)) {
    freed.push_back(std::move(earlier_.begin()->second));
    earlier_.erase(earlier_.begin());
  }
}

std::shared_ptr<Session> Roster::Find(const std::string& robot) const {
  const MutexLock lock(mutex_);
  const auto found = sessions_.find(HashName(robot));
  if (found == sessions_.end() || found->second->record().state().robot != robot) return nullptr;
  return found->second;
}

std::vector<std::shared_ptr<Session>> Roster::All() const {
  const MutexLock lock(mutex_);
  std::vector<std::shared_ptr<Session>> all;
  all.reserve(sessions_.size());
  for (const auto& [robot_id, session] : sessions_) all.push_back(session);
  return all;
}

std::vector<std::shared_ptr<Session>> Roster::InSite(const std::string& site) const {
  std::vector<std::shared_ptr<Session>> in_site;
  const auto add = [&](const std::shared_ptr<Session>& session) {
    if (session->record().state().site == site) in_site.push_back(session);
  };
  const MutexLock lock(mutex_);
  for (const auto& [id, session] : earlier_) add(session);
  for (const Leaving& leaving : gone_) {
    if (leaving.keep && HasDrawn(*leaving.session)) add(leaving.session);
  }
  for (const auto& [robot_id, session] : sessions_) add(session);
  return in_site;
}

DelayMeter::Quantiles Roster::waits() const {
  const DelayMeter newest = [this] {
    const MutexLock lock(waits_->mutex);
    return waits_->meter;
  }();
  return newest.quantiles();
}

std::uint64_t Roster::unclaimed_overflow() const {
  const MutexLock lock(mutex_);
  return unclaimed_.overflow();
}

}  // namespace cairn::server
