// How the roster restores the sessions of earlier servers (roster.h).
#include <spdlog/spdlog.h>

#include <asio/post.hpp>
#include <chrono>
#include <latch>
#include <utility>

#include "server/robots/roster.h"

namespace cairn::server {
namespace {

Result<StoredSession> ReadSession(Store& store, SessionId id) {
  Result<StoredSession> session = Fail(StatusCode::kDataLoss, "the store holds no session");
  const auto take = [&session](std::uint64_t, std::string_view bytes) -> Result<void> {
    session = SessionOf(bytes);
    return {};
  };
  if (auto read = store.Read({.kind = RecordKind::kSession, .owner = id}, take); !read)
    return tl::unexpected(read.error());
  return session;
}

}  // namespace

Roster::Restored Roster::RestoreEach(const std::vector<SessionId>& ids) {
  Restored sessions(ids.size(), Fail(StatusCode::kInternal, "not restored"));
  std::latch done(static_cast<std::ptrdiff_t>(ids.size()));
  for (std::size_t i = 0; i < ids.size(); ++i) {
    asio::post(pool_, [&, i] {
      try {
        sessions[i] = RestoreOne(ids[i]);
      } catch (const std::exception& error) {
        sessions[i] = Fail(StatusCode::kInternal, error.what());
      }
      done.count_down();
    });
  }
  done.wait();
  return sessions;
}

Result<void> Roster::Restore() {
  if (journal_ == nullptr) return {};
  const auto ids = journal_->store().Owners(RecordKind::kSession);
  if (!ids) return tl::unexpected(ids.error());
  const auto begin = std::chrono::steady_clock::now();
  const Restored sessions = RestoreEach(*ids);
  const MutexLock lock(mutex_);
  for (const auto& site : atlas_.All()) next_id_ = std::max(next_id_, site->last_layer() + 1);
  for (std::size_t i = 0; i < ids->size(); ++i) {
    next_id_ = std::max(next_id_, (*ids)[i] + 1);
    if (!sessions[i]) {
      if (sessions[i].error().code == StatusCode::kFailedPrecondition) return tl::unexpected(sessions[i].error());
      spdlog::error("session {} is not restored: {}", (*ids)[i], sessions[i].error().message);
      continue;
    }
    const std::shared_ptr<Session>& session = *sessions[i];
    const SessionState state = session->record().state();
    // A later session of the same robot takes the place of an earlier one, whose part of the map stays.
    sessions_.insert_or_assign(state.robot_id, session);
    if (const auto site = atlas_.Find(state.site)) site->Join(state.robot_id, session->id(), session);
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  spdlog::info("{} sessions restored in {:.2f} s", sessions_.size(), took.count());
  return {};
}

SessionId Roster::ReserveIds(std::uint64_t count) {
  const MutexLock lock(mutex_);
  return std::exchange(next_id_, next_id_ + count);
}

Result<void> Roster::HasRoomFor(const std::vector<std::string>& robots) const {
  const MutexLock lock(mutex_);
  if (sessions_.size() + robots.size() > static_cast<std::size_t>(options_.max_robots)) {
    return Fail(StatusCode::kResourceExhausted, std::to_string(sessions_.size()) + " robots have sessions; with " +
                                                    std::to_string(robots.size()) +
                                                    " more they are too many (robots.max_robots)");
  }
  for (const std::string& robot : robots) {
    if (sessions_.contains(HashName(robot)))
      return Fail(StatusCode::kAlreadyExists, "robot '" + robot + "' has a session, and a robot has one session");
  }
  return {};
}

std::size_t Roster::OpenStored(const std::vector<SessionId>& ids) {
  const Restored sessions = RestoreEach(ids);
  std::size_t taken = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (!sessions[i]) {
      spdlog::error("session {} is not restored: {}", ids[i], sessions[i].error().message);
      continue;
    }
    const std::shared_ptr<Session>& session = *sessions[i];
    const SessionState state = session->record().state();
    const MutexLock lock(mutex_);
    if (!sessions_.emplace(state.robot_id, session).second) continue;
    ++taken;
    if (const auto site = atlas_.Find(state.site)) site->Join(state.robot_id, session->id(), session);
  }
  return taken;
}

Result<std::shared_ptr<Site>> Roster::RemoveSite(const std::string& name) {
  std::vector<std::shared_ptr<Session>> removed;
  std::shared_ptr<Site> site;
  {
    const MutexLock lock(mutex_);
    site = atlas_.Find(name);
    if (site == nullptr) return Fail(StatusCode::kNotFound, "no site '" + name + "'");
    for (const auto& [robot_id, session] : sessions_) {
      const SessionState state = session->record().state();
      if (state.site != name) continue;
      if (state.phase == SessionPhase::kActive) {
        return Fail(StatusCode::kFailedPrecondition,
                    "robot '" + state.robot + "' is active in site '" + name + "'; end its session first");
      }
      removed.push_back(session);
    }
    for (const auto& session : removed) {
      session->KeepStored();
      if (journal_ != nullptr) journal_->Close(session->id());
      sessions_.erase(session->record().state().robot_id);
      gone_.push_back(session);
    }
    atlas_.Remove(name);
  }
  for (const auto& session : removed) session->End({StatusCode::kNotFound, "the site '" + name + "' was deleted"});
  return site;
}

Result<std::shared_ptr<Session>> Roster::RestoreOne(SessionId id) {
  const auto stored = ReadSession(journal_->store(), id);
  if (!stored) return tl::unexpected(stored.error());
  Result<std::shared_ptr<Site>> site = atlas_.Find(stored->request.site);
  if (*site == nullptr) site = atlas_.Enter(stored->request.site);
  if (!site) return tl::unexpected(site.error());
  const auto make = [&] {
    auto made = Make(id, stored->request, stored->map_epoch, *site);
    static_cast<void>(made->record().AddSensors(stored->request.sensors));
    return made;
  };
  std::shared_ptr<Session> session = make();
  const auto checkpoint = ReadCheckpoint(journal_->store(), id);
  std::uint64_t position = 0;
  if (checkpoint && *checkpoint) {
    if (const auto loaded = session->Load((*checkpoint)->bytes)) {
      position = (*checkpoint)->position;
    } else {
      // For example, the estimator has other options now. The whole journal can be replayed instead, if it is still
      // there.
      spdlog::warn("the checkpoint of session {} is not used: {}", id, loaded.error().message);
      session->KeepStored();
      session = make();
    }
  }
  const auto switched = [&site](std::uint32_t epoch, std::uint64_t generation) {
    return (*site)->Switched(epoch, generation);
  };
  const auto last =
      ReadJournal(journal_->store(), id, position, [&](std::uint64_t, JournalEntry&& entry) -> Result<void> {
        session->Replay(std::move(entry), switched);
        return {};
      });
  if (!last) {
    session->KeepStored();
    return tl::unexpected(last.error());
  }
  session->Replayed();
  journal_->Reopen(id, *last, DurableFor(session));
  return session;
}

}  // namespace cairn::server
