// How the roster opens sessions (roster.h).
#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "server/robots/roster.h"

namespace cairn::server {
namespace {

Pose2 StartOf(const SessionRequest& request) {
  if (!request.has_start) return {};
  Pose2 start = request.T_map_robot_start;
  start.theta = WrapAngle(start.theta);
  return start;
}

}  // namespace

// The session is known to others last: if an exception ends this, it is gone, and the client may ask again.
Result<void> Roster::Open(const SessionRequest& request) {
  const NameId robot_id = HashName(request.robot);
  std::shared_ptr<Session> session, gone;  // The memory of the one that goes is freed without the lock.
  std::shared_ptr<Site> site;
  StoredSession stored{.id = 0, .request = request};
  {
    const MutexLock lock(mutex_);
    // First the limit, then the site: a robot that is refused leaves no site behind.
    auto giving_way = GivesWay(robot_id);
    if (!giving_way) return tl::unexpected(giving_way.error());
    auto entered = atlas_.Enter(request.site);
    if (!entered) return tl::unexpected(entered.error());
    site = *std::move(entered);
    gone = *std::move(giving_way);
    stored.id = next_id_++;
    stored.map_epoch = site->snapshot()->info.epoch;
    stored.map_begun = HasBegun(request.site, *site, gone.get());
    stored.fragment = BeginsFragment(request, *site, stored.map_begun);
    if (!stored.fragment && !site->begun()) site->ForgetEditsOfLostMap();
    // The first that comes back after the state was lost: the others know their places in the same map.
    const bool elsewhere = request.has_start && request.map_frame != 0 && request.map_frame != site->map_frame();
    if (elsewhere && !stored.fragment && mapper_.filter.kind != slam::FilterKind::kLineMatch) {
      site->AdoptFrame(request.map_frame);
      for (const auto& [id, other] : sessions_) {
        if (other->record().state().site != request.site) continue;
        other->record().SetMapFrame(request.map_frame);
        other->Announce();
      }
    }
    session = Make(stored, site, mapper_);
    session->record().AddSensors(request.sensors);
    for (const std::string& sensor : request.sensors) {
      if (auto account = unclaimed_.Claim({robot_id, HashName(sensor), request.session})) {
        session->record().Inherit(HashName(sensor), std::move(*account));
      }
    }
  }
  if (journal_ != nullptr) {
    session->ExpectDurable();
    journal_->Open(stored, DurableFor(session));
  }
  session->Resume(request.client, request.session);
  Enter(*site, session);
  if (stored.fragment) {
    spdlog::warn(
        "robot {} {} in site {}, which has a map: it is not localized, and its part of the map is not shown, until it "
        "has driven through places that others have seen and a job joins it. With a start pose in this map it would be "
        "localized at once",
        request.robot, request.has_start ? "knows where it starts in another map only" : "did not say where it starts",
        request.site);
  }
  if (!TakePlace(session, gone, *site)) {
    if (journal_ != nullptr) journal_->Forget(session->id());
    return Fail(StatusCode::kUnavailable, "the site or a session of the robot has just changed; ask again");
  }
  try {
    RetireGone();
  } catch (const std::exception& error) {  // The session is open all the same, and the next Tick retires the others.
    spdlog::error("a session that gave way could not be ended because of an exception: {}", error.what());
  }
  return {};
}

// Since the site was entered, somebody may have deleted it, or loaded a session of the robot.
bool Roster::TakePlace(const std::shared_ptr<Session>& session, const std::shared_ptr<Session>& gone,
                       const Site& site) {
  const SessionState state = session->record().state();
  const NameId gone_id = gone != nullptr ? gone->record().state().robot_id : 0;
  const MutexLock lock(mutex_);
  const auto known = sessions_.find(state.robot_id);
  if (atlas_.Find(state.site).get() != &site || (known != sessions_.end() && known->second != gone)) return false;
  gone_.reserve(gone_.size() + 1);  // Where memory is short, an exception comes before anything has changed.
  std::shared_ptr<Session>& place = sessions_[state.robot_id];
  if (gone != nullptr) gone_.push_back({gone, gone == place});
  if (gone != nullptr && gone_id != state.robot_id) sessions_.erase(gone_id);
  place = session;
  return true;
}

bool Roster::BeginsFragment(const SessionRequest& request, const Site& site, bool map_begun) const {
  const bool in_this_map = request.map_frame == 0 || request.map_frame == site.map_frame();
  // The filter line_match finds the robot in a map that it was given.
  if ((request.has_start && in_this_map) || mapper_.filter.kind == slam::FilterKind::kLineMatch) return false;
  return map_begun;
}

bool Roster::HasBegun(const std::string& name, const Site& site, const Session* gone) const {
  if (site.begun()) return true;
  // Others may have begun a map that is not rendered yet, such as after a start.
  const auto has_drawn = [&name](const Session& session) {
    return session.record().state().site == name && session.record().begun() && !session.record().joining().fragment;
  };
  if (std::ranges::any_of(earlier_, [&](const auto& one) { return has_drawn(*one.second); }) ||
      std::ranges::any_of(gone_, [&](const Leaving& one) { return one.keep && has_drawn(*one.session); }))
    return true;
  return std::ranges::any_of(sessions_, [&](const auto& one) {
    const SessionRecord& record = one.second->record();
    const RobotStatus status = record.snapshot().status;
    const bool goes_on = status.session.phase != SessionPhase::kEnded && one.second.get() != gone;
    const bool draws = goes_on || status.pose.reason != PoseReason::kWaiting;
    return status.session.site == name && draws && !record.joining().fragment;
  });
}

// The session draws the site from now on.
void Roster::Enter(Site& site, const std::shared_ptr<Session>& session) {
  const SessionRecord& record = session->record();
  site.Join({.session = session->id(),
             .robot = record.state().robot_id,
             .owner = session,
             .epoch = record.epoch(),
             .fragment = record.joining().fragment,
             .ended = record.phase() == SessionPhase::kEnded});
}

std::shared_ptr<Session> Roster::Make(const StoredSession& stored, const std::shared_ptr<Site>& site,
                                      const slam::MapperOptions& mapper) const {
  const SessionId id = stored.id;
  const SessionSetup setup{.id = id,
                           .request = stored.request,
                           .map_epoch = stored.map_epoch,
                           .estimator = {.mapper = mapper,
                                         .T_map_robot_start = StartOf(stored.request),
                                         .fragment = stored.fragment,
                                         .map_begun = stored.map_begun,
                                         .known_grids = known_grids_},
                           .quiet_since_ms = stored.quiet_since_ms};
  SessionOutputs outputs{.send = [this](OutboundValue value) { return outbound_.Send(std::move(value)); },
                         .grid_changed = [site](GridChange&& change) { site->Change(std::move(change)); },
                         .store = {},
                         .map_begun = [site] { return site->begun(); },
                         .hidden = [site, id] { site->Hide(id); },
                         .ended = [site, id] { site->End(id); },
                         .gone =
                             [site, id, closing = closing_] {
                               if (!*closing) site->Leave(id);
                             },
                         .waited =
                             [waits = waits_](std::chrono::nanoseconds waited) {
                               const MutexLock lock(waits->mutex);
                               waits->meter.Add(waited);
                             }};
  const auto self = std::make_shared<std::weak_ptr<Session>>();
  if (journal_ != nullptr) {
    outputs.store = [journal = journal_, id, self](JournalEntry entry) {
      if (journal->Append(id, std::move(entry)) != 0) return true;
      if (const auto session = self->lock(); session != nullptr && journal->IsLost(id))
        session->Lost({StatusCode::kUnavailable, journal->health().reason});
      return false;
    };
    outputs.position = [journal = journal_, id] { return journal->position(id); };
    outputs.checkpointing = [journal = journal_, id] { return journal->IsCheckpointing(id); };
    outputs.checkpoint = [journal = journal_, id](std::uint64_t position, Journal::Content content,
                                                  Journal::Done done) {
      return journal->Checkpoint(id, position, std::move(content), std::move(done));
    };
    outputs.recover = [journal = journal_, id] { return journal->Recover(id); };
    outputs.abandon = [journal = journal_, id] { journal->Abandon(id); };
    outputs.checkpoint_limits = {
        static_cast<std::uint64_t>(options_.checkpoint_entries),
        std::chrono::duration_cast<CheckpointPace::Time>(std::chrono::duration<double>(options_.checkpoint_work_s))};
  }
  auto session = std::make_shared<Session>(setup, options_, pool_, std::move(outputs));
  session->record().SetMapFrame(site->map_frame());
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
  const std::chrono::duration<double> kept(options_.place_kept_s);
  std::shared_ptr<Session> ended, suspended;
  for (const auto& [id, session] : sessions_) {
    const SessionRecord& record = session->record();
    const bool is_ended = record.phase() == SessionPhase::kEnded;
    if (is_ended && (ended == nullptr || session->id() < ended->id())) ended = session;
    const auto away = record.SuspendedFor(now);
    if (record.AwayFor(now) >= kept &&
        away > (suspended == nullptr ? away.zero() : suspended->record().SuspendedFor(now)))
      suspended = session;
  }
  if (ended != nullptr) return ended;
  if (suspended != nullptr) return suspended;
  return Fail(StatusCode::kResourceExhausted,
              std::to_string(sessions_.size()) + " robots have open sessions; the limit is robots.max_robots");
}

}  // namespace cairn::server
