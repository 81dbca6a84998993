#include "server/robots/roster.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <utility>

#include "common/service/start_pose.h"

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

Pose2 StartOf(const SessionRequest& request) {
  if (!request.has_start) return {};
  Pose2 start = request.T_map_robot_start;
  start.theta = WrapAngle(start.theta);
  return start;
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
  try {
    if (auto admitted = Admit(request); !admitted) Refuse(request, admitted.error());
  } catch (const std::exception& error) {
    spdlog::error("a session of robot {} could not be opened because of an exception: {}", request.robot, error.what());
    Refuse(request, {StatusCode::kInternal, "internal error of the server; see its log for the cause"});
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
  if (request.started) {
    return Fail(StatusCode::kFailedPrecondition, "the server does not know this session of '" + request.robot +
                                                     "'; open a new one" + WhyNotRestored(request.robot));
  }
  if (session == nullptr || session->record().phase() == SessionPhase::kEnded) return Open(request);
  return request.has_start ? Replace(*session, request) : Resume(*session, request);
}

std::string Roster::WhyNotRestored(const std::string& robot) const {
  const MutexLock lock(mutex_);
  const auto found = not_restored_.find(robot);
  return found == not_restored_.end() ? std::string() : " (" + found->second + ")";
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
    return Fail(StatusCode::kFailedPrecondition,
                "'" + request.robot + "' has an open session in site '" + state.site + "'; end it first");
  }
  return {};
}

// A client that says where the robot starts gets a new session instead of the old one.
Result<void> Roster::Replace(Session& session, const SessionRequest& request) {
  if (auto may = MayTakeOver(session, request); !may) return may;
  const SessionState state = session.record().state();
  if (auto opened = Open(request); !opened) return opened;
  session.End({StatusCode::kAborted, "a new session of '" + state.robot + "' was opened with a start pose"});
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

// The session is known to others last: if an exception ends this, it is gone, and the client may ask again.
Result<void> Roster::Open(const SessionRequest& request) {
  const NameId robot_id = HashName(request.robot);
  std::shared_ptr<Session> session, gone;  // The memory of the one that goes is freed without the lock.
  std::shared_ptr<Site> site;
  {
    const MutexLock lock(mutex_);
    // First the limit, then the site: a robot that is refused leaves no site behind.
    auto giving_way = GivesWay(robot_id);
    if (!giving_way) return tl::unexpected(giving_way.error());
    auto entered = atlas_.Enter(request.site);
    if (!entered) return tl::unexpected(entered.error());
    site = *std::move(entered);
    gone = *std::move(giving_way);
    session = Make(next_id_++, request, site->snapshot()->info.epoch, site);
    session->record().AddSensors(request.sensors);
    for (const std::string& sensor : request.sensors) {
      if (auto account = unclaimed_.Claim({robot_id, HashName(sensor), request.session})) {
        session->record().Inherit(HashName(sensor), std::move(*account));
      }
    }
  }
  if (journal_ != nullptr) {
    session->ExpectDurable();
    journal_->Open({session->id(), request, session->record().epoch()}, DurableFor(session));
  }
  session->Resume(request.client, request.session);
  site->Join(robot_id, session->id(), session, session->record().epoch());
  {
    const MutexLock lock(mutex_);
    if (gone != nullptr) gone_.push_back(gone);
    std::shared_ptr<Session>& place = sessions_[robot_id];
    if (gone != nullptr && gone != place) sessions_.erase(gone->record().state().robot_id);
    place = session;
  }
  try {
    RetireGone();
  } catch (const std::exception& error) {  // The session is open all the same, and the next Tick retires the others.
    spdlog::error("a session that gave way could not be ended because of an exception: {}", error.what());
  }
  return {};
}

std::shared_ptr<Session> Roster::Make(SessionId id, const SessionRequest& request, std::uint32_t map_epoch,
                                      const std::shared_ptr<Site>& site) const {
  const SessionSetup setup{
      .id = id,
      .request = request,
      .map_epoch = map_epoch,
      .estimator = {.mapper = mapper_, .T_map_robot_start = StartOf(request), .start_known = request.has_start}};
  SessionOutputs outputs{.send = [this](OutboundValue value) { return outbound_.Send(std::move(value)); },
                         .grid_changed = [site](GridChange&& change) { site->Change(std::move(change)); },
                         .store = {},
                         .gone =
                             [site, id, closing = closing_] {
                               if (!*closing) site->Leave(id);
                             }};
  const auto self = std::make_shared<std::weak_ptr<Session>>();
  if (journal_ != nullptr) {
    outputs.store = [journal = journal_, id, self](JournalEntry entry) {
      if (journal->Append(id, std::move(entry)) != 0) return true;
      if (const auto session = self->lock()) session->Lost({StatusCode::kUnavailable, journal->health().reason});
      return false;
    };
    outputs.position = [journal = journal_, id] { return journal->position(id); };
    outputs.checkpoint = [journal = journal_, id](std::uint64_t position, Journal::Content content) {
      return journal->Checkpoint(id, position, std::move(content));
    };
    outputs.checkpoint_entries = static_cast<std::uint64_t>(options_.checkpoint_entries);
  }
  auto session = std::make_shared<Session>(setup, options_, pool_, std::move(outputs));
  *self = session;
  return session;
}

Journal::Durable Roster::DurableFor(const std::shared_ptr<Session>& session) const {
  return [weak = std::weak_ptr(session)](const std::vector<JournalEntry>& entries) {
    if (const auto known = weak.lock()) known->Durable(entries);
  };
}

Result<std::shared_ptr<Session>> Roster::GivesWay(NameId robot_id) const {
  const auto own = sessions_.find(robot_id);
  if (own != sessions_.end()) return own->second;
  if (sessions_.size() < static_cast<std::size_t>(options_.max_robots)) return nullptr;
  const auto now = SessionRecord::Clock::now();
  std::shared_ptr<Session> ended, suspended;
  for (const auto& [id, session] : sessions_) {
    const SessionRecord& record = session->record();
    const bool is_ended = record.phase() == SessionPhase::kEnded;
    if (is_ended && (ended == nullptr || session->id() < ended->id())) ended = session;
    const auto away = record.SuspendedFor(now);
    if (away > (suspended == nullptr ? away.zero() : suspended->record().SuspendedFor(now))) suspended = session;
  }
  if (ended != nullptr) return ended;
  if (suspended != nullptr) return suspended;
  return Fail(StatusCode::kResourceExhausted,
              std::to_string(sessions_.size()) + " robots have open sessions; the limit is robots.max_robots");
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
  for (const auto& session : All()) {
    if (session->record().owner() == liveliness.client) session->SetLiveliness(liveliness.alive);
  }
}

Result<void> Roster::End(const std::string& robot) {
  const std::shared_ptr<Session> session = Find(robot);
  if (session == nullptr) return Fail(StatusCode::kNotFound, "robot '" + robot + "' has no session");
  session->End();
  return {};
}

void Roster::Tick() {
  const std::chrono::duration<double> expiry(options_.suspended_expiry_s);
  for (const auto& session : All()) {
    session->Tick();
    if (session->record().SuspendedFor(SessionRecord::Clock::now()) > expiry)
      session->End({StatusCode::kDeadlineExceeded, "its robot stayed away for longer than robots.suspended_expiry_s"});
  }
  SendRefusals();
  RetireGone();
  const MutexLock lock(mutex_);
  for (Ledger& ledger : unclaimed_.TakeChanged()) outbound_.Send(std::move(ledger));
  unclaimed_.ForgetSilent(UnclaimedStreams::Clock::now(), [this](const Ledger& ledger) CAIRN_REQUIRES(mutex_) {
    const auto session = sessions_.find(ledger.robot_id);
    const bool used = session != sessions_.end() && session->second->record().Has(ledger.sensor_id);
    return used || outbound_.Send(Retired{ledger});
  });
}

// Once a removed session has published its last state, its keys on the wire that no other session uses are retired.
void Roster::RetireGone() {
  std::vector<std::shared_ptr<Session>> freed;  // Destroyed after the lock is released.
  const MutexLock lock(mutex_);
  std::erase_if(gone_, [&](const std::shared_ptr<Session>& gone) CAIRN_REQUIRES(mutex_) {
    const auto successor = sessions_.find(gone->record().state().robot_id);
    if (successor == sessions_.end()) {
      if (!gone->ending() && gone->record().phase() != SessionPhase::kEnded)
        gone->End({StatusCode::kResourceExhausted, "its robot stayed away, and its place was needed for another"});
      gone->Tick();
    }
    if (gone->record().phase() != SessionPhase::kEnded || gone->has_work()) return false;
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
    if (retired) freed.push_back(gone);
    return retired;
  });
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
  for (const auto& session : All()) {
    if (session->record().state().site == site) in_site.push_back(session);
  }
  return in_site;
}

std::uint64_t Roster::unclaimed_overflow() const {
  const MutexLock lock(mutex_);
  return unclaimed_.overflow();
}

}  // namespace cairn::server
