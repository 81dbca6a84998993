// How the roster takes up the sessions of the servers before this one (roster.h).
#include <spdlog/spdlog.h>

#include <asio/post.hpp>
#include <chrono>
#include <latch>
#include <utility>

#include "server/robots/roster.h"
#include "server/store/restore_marks.h"

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

constexpr std::uint32_t kDeathsWithJournal = 2;     // After so many the journal is left out,
constexpr std::uint32_t kDeathsWithCheckpoint = 3;  // and after so many the checkpoint as well.

// What a server that is not sure to survive its start says of a session.
std::string AfterDeaths(std::uint32_t deaths) {
  return "the server ended " + std::to_string(deaths) + " times while it restored this session";
}

}  // namespace

Result<void> Roster::Restore() {
  if (journal_ == nullptr) return {};
  const auto ids = journal_->store().Owners(RecordKind::kSession);
  if (!ids) return tl::unexpected(ids.error());
  auto marks = RestoreMarks::Read(journal_->store());
  if (!marks) return tl::unexpected(marks.error());
  const auto begin = std::chrono::steady_clock::now();
  std::vector<SessionId> trusted, doubted;
  for (const SessionId id : *ids) {
    (marks->deaths(id) == 0 ? trusted : doubted).push_back(id);
    const MutexLock lock(mutex_);
    next_id_ = std::max(next_id_, id + 1);
  }
  if (auto restored = RestoreTogether(trusted, *marks); !restored) return restored;
  // One of these may have ended the server before. One at a time, so that it alone is marked when it does so again.
  for (const SessionId id : doubted) {
    if (auto restored = RestoreDoubted(id, *marks); !restored) return restored;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  spdlog::info("{} sessions restored in {:.2f} s", All().size(), took.count());
  return {};
}

Result<void> Roster::RestoreTogether(const std::vector<SessionId>& ids, RestoreMarks& marks) {
  if (auto marked = marks.Begin(ids); !marked) return marked;
  std::vector<Result<std::shared_ptr<Session>>> sessions(ids.size(), Fail(StatusCode::kInternal, "not restored"));
  std::latch done(static_cast<std::ptrdiff_t>(ids.size()));
  for (std::size_t i = 0; i < ids.size(); ++i) {
    asio::post(pool_, [&, i] {
      sessions[i] = RestoreOne(ids[i], true);
      done.count_down();
    });
  }
  done.wait();
  if (auto unmarked = marks.Succeeded(ids); !unmarked) return unmarked;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (auto taken = TakeUp(ids[i], std::move(sessions[i])); !taken) return taken;
  }
  return {};
}

Result<void> Roster::RestoreDoubted(SessionId id, RestoreMarks& marks) {
  const std::uint32_t deaths = marks.deaths(id);
  if (deaths >= kDeathsWithCheckpoint) return TakeUp(id, NotRestored(id, {StatusCode::kAborted, AfterDeaths(deaths)}));
  if (auto marked = marks.Begin({id}); !marked) return marked;
  const bool with_journal = deaths < kDeathsWithJournal;
  auto session = RestoreOne(id, with_journal);
  if (auto unmarked = marks.Succeeded({id}); !unmarked) return unmarked;
  if (with_journal || !session) return TakeUp(id, std::move(session));
  // The robot has moved on since the checkpoint, and what it did is left out: it starts a new session. This one's part
  // of the map stays, as that of any session that is gone.
  return TakeUp(id, NotRestored(id, {StatusCode::kAborted, AfterDeaths(deaths) + "; its newest data is left out"}));
}

// Makes the session known, or the reason why it is not.
Result<void> Roster::TakeUp(SessionId id, Result<std::shared_ptr<Session>> restored) {
  if (!restored) {
    if (restored.error().code == StatusCode::kFailedPrecondition) return tl::unexpected(restored.error());
    spdlog::error("session {} is not restored: {}", id, restored.error().message);
    return {};
  }
  const MutexLock lock(mutex_);
  const std::shared_ptr<Session>& session = *restored;
  const SessionState state = session->record().state();
  // A later session of the same robot takes the place of an earlier one, whose part of the map stays.
  const auto [known, first] = sessions_.try_emplace(state.robot_id, session);
  if (!first && known->second->id() > id) return {};
  known->second = session;
  if (const auto site = atlas_.Find(state.site)) site->Join(state.robot_id, session->id(), session);
  return {};
}

// So that the robot can be told why it must open a new session.
Result<std::shared_ptr<Session>> Roster::NotRestored(SessionId id, Status why) {
  if (const auto stored = ReadSession(journal_->store(), id)) {
    const MutexLock lock(mutex_);
    not_restored_[stored->request.robot] = why.message;
  }
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

Result<std::shared_ptr<Session>> Roster::ReadBack(SessionId id, bool with_journal) {
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
  if (!checkpoint) {
    // The whole journal, where it is still there, does as well.
    spdlog::warn("the checkpoint of session {} is not used: {}", id, checkpoint.error().message);
  } else if (*checkpoint) {
    if (const auto loaded = session->Load((*checkpoint)->bytes)) {
      position = (*checkpoint)->position;
    } else {
      // For example, other options of the estimator.
      spdlog::warn("the checkpoint of session {} is not used: {}", id, loaded.error().message);
      session->Disown();
      session = make();
    }
  }
  const auto switched = [&site](std::uint32_t epoch, std::uint64_t generation) {
    return (*site)->Switched(epoch, generation);
  };
  if (!with_journal) {
    session->Replayed();
    return session;
  }
  const auto last =
      ReadJournal(journal_->store(), id, position, [&](std::uint64_t, JournalEntry&& entry) -> Result<void> {
        session->Replay(std::move(entry), switched);
        return {};
      });
  // Without the checkpoint and without any entry it would begin where the robot once stood.
  const bool checkpoint_unused = position == 0 && (!checkpoint || *checkpoint);
  if (!last || (checkpoint_unused && *last == 0)) {
    session->Disown();
    if (!last) return tl::unexpected(last.error());
    return Fail(StatusCode::kDataLoss, "its checkpoint cannot be used, and the journal before it was removed");
  }
  session->Replayed();
  journal_->Reopen(id, *last, DurableFor(session));
  return session;
}

}  // namespace cairn::server
