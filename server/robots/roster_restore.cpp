// How the roster restores the sessions of earlier servers (roster.h).
#include <spdlog/spdlog.h>

#include <asio/post.hpp>
#include <chrono>
#include <latch>
#include <set>
#include <utility>

#include "server/robots/roster.h"
#include "server/store/restore_marks.h"
#include "server/store/site_contents.h"

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

constexpr std::uint32_t kAttemptsWithJournal = 2;     // After so many failures the journal is not used,
constexpr std::uint32_t kAttemptsWithCheckpoint = 3;  // and after so many neither is the checkpoint.

// Why a session is not restored, or not completely.
std::string AfterFailures(std::uint32_t failures) {
  return "the server ended " + std::to_string(failures) + " times while it restored this session";
}

}  // namespace

Roster::Restored Roster::RestoreEach(const std::vector<SessionId>& ids) {
  Restored sessions(ids.size(), Fail(StatusCode::kInternal, "not restored"));
  std::latch done(static_cast<std::ptrdiff_t>(ids.size()));
  for (std::size_t i = 0; i < ids.size(); ++i) {
    asio::post(pool_, [&, i] {
      sessions[i] = RestoreOne(ids[i], true);
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
  const auto last = LastSession(journal_->store());
  if (!last) return tl::unexpected(last.error());
  auto marks = RestoreMarks::Read(journal_->store());
  if (!marks) return tl::unexpected(marks.error());
  const auto begin = std::chrono::steady_clock::now();
  std::vector<SessionId> doubtful, others;
  {
    const MutexLock lock(mutex_);
    next_id_ = std::max(next_id_, *last + 1);
    for (const SessionId id : *ids) {
      (marks->failed(id) == 0 ? others : doubtful).push_back(id);
    }
  }
  if (auto restored = RestoreTogether(others, *marks); !restored) return restored;
  // One of these may have ended the server before. One at a time, so that it alone is marked when it does so again.
  for (const SessionId id : doubtful) {
    if (auto restored = RestoreDoubtful(id, *marks); !restored) return restored;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  spdlog::info("{} sessions restored in {:.2f} s", All().size(), took.count());
  return {};
}

Result<void> Roster::RestoreTogether(const std::vector<SessionId>& ids, RestoreMarks& marks) {
  if (auto marked = marks.Begin(ids); !marked) return marked;
  Restored sessions = RestoreEach(ids);
  if (auto unmarked = marks.Succeeded(ids); !unmarked) return unmarked;
  for (std::size_t i = 0; i < ids.size(); ++i) Register(ids[i], std::move(sessions[i]));
  return {};
}

Result<void> Roster::RestoreDoubtful(SessionId id, RestoreMarks& marks) {
  const std::uint32_t failures = marks.failed(id);
  if (failures >= kAttemptsWithCheckpoint) {
    Register(id, NotRestored(id, {StatusCode::kAborted, AfterFailures(failures)}));
    return {};
  }
  if (auto marked = marks.Begin({id}); !marked) return marked;
  const bool with_journal = failures < kAttemptsWithJournal;
  auto session = RestoreOne(id, with_journal);
  if (with_journal) {
    if (auto unmarked = marks.Succeeded({id}); !unmarked) return unmarked;
    Register(id, std::move(session));
    return {};
  }
  // Every later start does the same. Where the checkpoint cannot be used either, it is not read again.
  if (session) {
    if (auto marked = marks.Set(id, failures); !marked) return marked;
  }
  // The robot has moved on since the checkpoint, so it begins a new session. What is stored of this one stays, and its
  // part of the map is shown as it was in the checkpoint.
  const Status why = session ? Status{StatusCode::kAborted, AfterFailures(failures)} : session.error();
  Register(id, NotRestored(id, why));
  return {};
}

// Makes the session known, or the reason why it is not.
void Roster::Register(SessionId id, Result<std::shared_ptr<Session>> restored) {
  if (!restored) return;  // NotRestored has set it aside.
  const MutexLock lock(mutex_);
  const auto known = sessions_.find((*restored)->record().state().robot_id);
  Place(*restored, known == sessions_.end() || known->second->id() < id);
}

// `first`: the session becomes the present one of its robot, and the one before becomes an earlier session; else it is
// an earlier session itself.
void Roster::Place(const std::shared_ptr<Session>& session, bool first) {
  const SessionState state = session->record().state();
  if (const auto site = atlas_.Find(state.site)) Enter(*site, session);
  std::shared_ptr<Session> earlier = session;
  if (first) std::swap(earlier, sessions_[state.robot_id]);
  if (earlier == nullptr) return;
  earlier->End({StatusCode::kAborted, "another session of '" + state.robot + "' follows"});
  gone_.push_back({std::move(earlier), true});
}

// Sets the session aside. The robot can be told why it must open a new one.
Result<std::shared_ptr<Session>> Roster::NotRestored(SessionId id, Status why) {
  std::string what = "session " + std::to_string(id), site;
  if (const auto stored = ReadSession(journal_->store(), id)) {
    site = stored->request.site;
    what += " of robot '" + stored->request.robot + "' in site '" + site + "'";
    const MutexLock lock(mutex_);
    not_restored_[stored->request.robot] = why.message;
  }
  spdlog::error("{}", journal_->set_aside().Add(site, what, why));
  return tl::unexpected(std::move(why));
}

Result<std::shared_ptr<Session>> Roster::RestoreOne(SessionId id, bool with_journal) {
  try {
    auto restored = ReadBack(id, with_journal);
    return restored ? std::move(restored) : NotRestored(id, restored.error());
  } catch (const std::exception& error) {
    return NotRestored(id, {StatusCode::kInternal, error.what()});
  }
}

SessionId Roster::ReserveIds(std::uint64_t count) {
  const MutexLock lock(mutex_);
  return std::exchange(next_id_, next_id_ + count);
}

Result<void> Roster::HasRoomFor(const std::set<std::string>& robots) const {
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
  const std::set<SessionId> loaded(ids.begin(), ids.end());
  std::size_t taken = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (!sessions[i]) continue;  // NotRestored has set it aside.
    const MutexLock lock(mutex_);
    const auto known = sessions_.find((*sessions[i])->record().state().robot_id);
    Place(*sessions[i],
          known == sessions_.end() || (loaded.contains(known->second->id()) && known->second->id() < ids[i]));
    ++taken;
  }
  return taken;
}

Result<std::shared_ptr<Site>> Roster::RemoveSite(const std::string& name) {
  std::vector<std::shared_ptr<Session>> removed, earlier;  // Freed without the lock.
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
    const auto leaves_its_records = [this](Session& session) {
      session.KeepStored();
      if (journal_ != nullptr) journal_->Close(session.id());
    };
    for (const auto& session : removed) {
      leaves_its_records(*session);
      sessions_.erase(session->record().state().robot_id);
      gone_.push_back({session, false});
    }
    for (Leaving& leaving : gone_) {
      if (leaving.session->record().state().site == name && leaving.keep) leaves_its_records(*leaving.session);
      leaving.keep = leaving.keep && leaving.session->record().state().site != name;
    }
    std::erase_if(earlier_, [&](const auto& one) {
      if (one.second->record().state().site != name) return false;
      leaves_its_records(*one.second);
      earlier.push_back(one.second);
      return true;
    });
    atlas_.Remove(name);
  }
  for (const auto& session : removed) session->End({StatusCode::kNotFound, "the site '" + name + "' was deleted"});
  return site;
}

Result<std::shared_ptr<Session>> Roster::ReadBack(SessionId id, bool with_journal) {
  const auto stored = ReadSession(journal_->store(), id);
  if (!stored) return tl::unexpected(stored.error());
  Result<std::shared_ptr<Site>> site = atlas_.Find(stored->request.site);
  if (*site == nullptr) site = atlas_.Enter(stored->request.site);
  if (!site) return tl::unexpected(site.error());
  const auto make = [&] {
    auto made = Make(*stored, *site);
    made->KeepStored();  // Also if an exception ends the restore.
    static_cast<void>(made->record().AddSensors(stored->request.sensors));
    return made;
  };
  std::shared_ptr<Session> session = make();
  const auto checkpoint = ReadCheckpoint(journal_->store(), id);
  std::uint64_t position = 0;
  StoredPieces pieces;
  if (!checkpoint && checkpoint.error().code != StatusCode::kDataLoss) {
    // For example, a newer server has written it: to go on without it would end in writing over it.
    return tl::unexpected(checkpoint.error());
  }
  if (!checkpoint) {
    // The whole journal is used instead, if it is still there.
    spdlog::warn("the checkpoint of session {} is not used: {}", id, checkpoint.error().message);
  } else if (*checkpoint) {
    for (const auto& [number, parts] : (*checkpoint)->parts) pieces.emplace(number, StoredPiece{nullptr, parts});
    if (const auto loaded = session->Load((*checkpoint)->bytes, (*checkpoint)->PiecesInOrder())) {
      position = (*checkpoint)->position;
      for (std::size_t i = 0; i < loaded->size(); ++i) pieces[(*checkpoint)->order[i]].value = (*loaded)[i];
    } else if (loaded.error().code == StatusCode::kUnimplemented) {
      return tl::unexpected(loaded.error());  // A newer server has written it.
    } else {
      // For example, the estimator has other options now. The whole journal can be replayed instead, if it is still
      // there.
      spdlog::warn("the checkpoint of session {} is not used: {}", id, loaded.error().message);
      session = make();
    }
  }
  const auto switched = [&site](std::uint32_t epoch, std::uint64_t generation) {
    return (*site)->Switched(epoch, generation);
  };
  if (!with_journal) {
    if (position == 0)
      return Fail(StatusCode::kDataLoss, "it has no checkpoint that can be used, and its journal is left out");
    session->Replayed();
    return session;  // To be dropped, with its records kept.
  }
  const auto last =
      ReadJournal(journal_->store(), id, position, [&](std::uint64_t, JournalEntry&& entry) -> Result<void> {
        session->Replay(std::move(entry), switched);
        return {};
      });
  // Without the checkpoint and without any entry it would begin where the robot once stood.
  const bool checkpoint_unused = position == 0 && (!checkpoint || *checkpoint);
  if (!last) return tl::unexpected(last.error());
  if (checkpoint_unused && *last == 0)
    return Fail(StatusCode::kDataLoss, "its checkpoint cannot be used, and the journal before it was removed");
  session->Replayed();
  session->SetCheckpointed(position);
  journal_->Reopen(id, *last, DurableFor(session), position, std::move(pieces));
  session->KeepStored(false);
  return session;
}

}  // namespace cairn::server
